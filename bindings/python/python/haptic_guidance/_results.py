"""What the simulator and the estimators hand back, arranged for Python."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np

from . import _native
from ._errors import InputError
from ._native import Scenario

if TYPE_CHECKING:
    import pandas
    import pyarrow

_METRICS = tuple(definition["name"] for definition in _native.metric_definitions())


@dataclass(frozen=True)
class Run:
    """A simulated run.

    Attributes
    ----------
    scenario : Scenario
        What was simulated.
    columns : dict of str to numpy.ndarray
        The truth, 200 samples a second, by name with unit. ``run["time_s"]`` is short for one.
    steps : int
        Steps simulated; one is 1 ms.
    results : dict
        What ``host-sim run --json`` prints.
    events : list of (float, str)
        What the ECU said of itself: time in s, and what.
    bus : dict of str to numpy.ndarray or None
        Every frame, if asked for: ``t_us``, ``id`` and ``data`` (eight bytes a row), in order.
    """

    scenario: Scenario
    columns: dict[str, np.ndarray] = field(repr=False)
    steps: int
    results: dict[str, Any] = field(repr=False)
    events: list[tuple[float, str]] = field(repr=False)
    bus: Optional[dict[str, np.ndarray]] = field(default=None, repr=False)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    @property
    def ending(self) -> str:
        """How it ended: ``"course-end"`` or ``"diverged"``."""
        return "diverged" if self.results["diverged"] else "course-end"

    @property
    def metrics(self) -> dict[str, Optional[float]]:
        """The metrics over ``results["window_m"]``; `metric_definitions` says what each means. None: no value."""
        return {name: self.results[name] for name in _METRICS}

    def to_pandas(self) -> pandas.DataFrame:
        """The columns as a frame that shares their memory (needs pandas)."""
        import pandas

        return pandas.DataFrame(self.columns, copy=False)

    def to_arrow(self) -> pyarrow.Table:
        """The columns as a table that shares their memory (needs pyarrow)."""
        import pyarrow

        return pyarrow.table({name: pyarrow.array(column) for name, column in self.columns.items()})


def simulate(scenario: Scenario, *, bus: bool = False) -> Run:
    """Simulate a scenario to its end.

    Parameters
    ----------
    scenario : Scenario
        What to simulate.
    bus : bool, optional
        Whether to keep every frame of the bus; takes ``sensors="paper"`` and a condition with guidance.

    Returns
    -------
    Run

    Raises
    ------
    RangeError
        A failure or a change of the driver that comes after the end of the run.
    InputError
        A bus to record where there is none.
    """
    made = _native.simulate(scenario, bus)
    return Run(scenario, made["columns"], made["steps"], made["results"], made["events"], made.get("bus"))


@dataclass(frozen=True)
class Evaluation:
    """The paper's evaluation.

    Attributes
    ----------
    results : dict
        What ``host-sim evaluate --json`` prints: a record for each run, and the claims.
    columns : list of dict
        The columns of each run, in the order of ``results["runs"]``.
    """

    results: dict[str, Any] = field(repr=False)
    columns: list[dict[str, np.ndarray]] = field(repr=False)

    @property
    def all_claims_hold(self) -> bool:
        """Whether no claim is broken."""
        return all(claim["holds"] for claim in self.results["claims"])

    def to_pandas(self) -> pandas.DataFrame:
        """One row for each run (needs pandas)."""
        import pandas

        return pandas.DataFrame(self.results["runs"])


def evaluate(
    scenario: Optional[Scenario] = None,
    *,
    window_m: Optional[tuple[float, float]] = None,
    progress: Optional[Callable[[int], object]] = None,
) -> Evaluation:
    """Run the paper's evaluation: three drivers, four conditions, with and without failure.

    Parameters
    ----------
    scenario : Scenario, optional
        Gives course, speed, sensors, vehicle, guidance and the time of the failure.
    window_m : (float, float), optional
        Stretch to measure, m along the course.
    progress : callable, optional
        Called with the number of runs done since the last call, such as ``tqdm.tqdm(total=30).update``.

    Returns
    -------
    Evaluation
    """
    window = None if window_m is None else list(window_m)
    made = _native.evaluate(Scenario() if scenario is None else scenario, window, progress)
    return Evaluation(made["results"], made["columns"])


@dataclass(frozen=True)
class Parameter:
    """One identified parameter of a driver.

    Attributes
    ----------
    name, unit : str
        The paper's symbol and its unit.
    estimate : float or None
        None where the data do not identify it.
    standard_error : float or None
        None where the data put no bound on it.
    interval_95 : (float, float) or None
        95 % interval, cut to the range that the parameter can have.
    identified, on_bound, fixed : bool
        Whether the data identify it, whether the search ended on a bound, whether it was given.
    optimum : float or None
        Where the search ended.
    """

    name: str
    unit: str
    estimate: Optional[float]
    standard_error: Optional[float]
    interval_95: Optional[tuple[float, float]]
    identified: bool
    on_bound: bool
    fixed: bool
    optimum: Optional[float]


@dataclass(frozen=True)
class Fit:
    """An identified driver.

    Attributes
    ----------
    parameters : dict of str to Parameter
        By the paper's symbol in lower case. ``fit["k_d"]`` is short for one.
    results : dict
        What ``host-sim identify --json`` prints.
    traces : dict of str to numpy.ndarray
        Measured and simulated torque and the residuals, over time.
    """

    parameters: dict[str, Parameter]
    results: dict[str, Any] = field(repr=False)
    traces: dict[str, np.ndarray] = field(repr=False)

    def __getitem__(self, name: str) -> Parameter:
        return self.parameters[name]

    @property
    def fit_percent(self) -> float:
        """Fit of the simulated driver torque, 100*(1 - |y - yhat|/|y - mean y|)."""
        return self.results["fit_percent"]

    @property
    def notes(self) -> list[str]:
        """What the data or the log could not give."""
        return self.results["notes"]

    @property
    def refuted(self) -> list[Any]:
        """Assumptions that the record refutes: with any, nothing is identified."""
        return self.results["refuted"]

    @property
    def residuals_are_white(self) -> bool:
        """Whether the residuals are white, as they must be for the standard errors to hold."""
        return self.results["whiteness"]["white"]

    @property
    def covariance(self) -> tuple[list[str], np.ndarray]:
        """Names, and the covariance of the errors of those parameters; NaN where a variance is unbounded."""
        names = self.results["correlation"]["names"]
        matrix = np.array(self.results["correlation"]["matrix"], dtype=float).reshape(len(names), len(names))
        errors = np.array([self.parameters[name].standard_error for name in names], dtype=float)
        return names, matrix * np.outer(errors, errors)


def identify(
    drive: Union[str, os.PathLike[str], Mapping[str, Any], Run],
    *,
    manual: bool = False,
    fix: Optional[Mapping[str, float]] = None,
    estimate: Optional[Mapping[str, Optional[tuple[float, float]]]] = None,
    between_s: Sequence[tuple[float, float]] = (),
    as_published: bool = False,
) -> Fit:
    """Identify the driver of a recorded drive.

    Parameters
    ----------
    drive : path, mapping or Run
        A CSV, MAT or MDF 4 file, a recording of the bus (candump, ASC, BLF); columns by name (a DataFrame is a mapping
        too); or a run.
        Needed are ``time_s``, ``e_y_m``, ``e_theta_rad``, ``wheel_angle_rad``, ``guidance_torque_nm`` and
        ``driver_torque_nm``.
    manual : bool, optional
        A drive without guidance: K_hg is no part of the model.
    fix : mapping of str to float, optional
        Parameters that are known, such as ``{"k_nms": 1.0}``.
    estimate : mapping of str to (float, float) or None, optional
        What else to estimate, with its range or None for the widest: ``k_nms``, ``t_nms``, ``t_h_late``, ``t_d_late``.
    between_s : sequence of (float, float), optional
        Stretches of the drive to use, s; all of it if not given.
    as_published : bool, optional
        The paper's method instead of prediction errors with a noise model.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        A column that is missing, uneven in time, in a wrong unit or too short; a parameter that cannot be fixed.
    """
    fixed = [f"{name}={float(value)!r}" for name, value in (fix or {}).items()]
    wanted = [name if ends is None else f"{name}={ends[0]!r}..{ends[1]!r}" for name, ends in (estimate or {}).items()]
    options = (manual, fixed, wanted, [list(stretch) for stretch in between_s], as_published)
    if isinstance(drive, (str, os.PathLike)):
        made = _native.identify(os.fspath(drive), None, *options)
    else:
        table = drive.columns if isinstance(drive, Run) else drive
        columns = {str(name): _column(name, table[name]) for name in table.keys()}
        made = _native.identify(None, {n: c for n, c in columns.items() if c is not None}, *options)
    parameters = {}
    for name, unit in made["units"].items():
        found = dict(made["results"]["parameters"][name])
        interval = found.pop("interval_95")
        parameters[name] = Parameter(
            name=name, unit=unit, interval_95=None if interval is None else tuple(interval), **found
        )
    return Fit(parameters, made["results"], made["traces"])


def _column(name: Any, values: Any) -> Optional[np.ndarray]:
    """A column as float64; None for one that is no numbers, which the estimator may not need."""
    try:
        column = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if column.ndim != 1:
        raise InputError(f"{name}: {column.ndim} dimensions, one is wanted")
    return column
