"""What the simulator and the estimators hand back, arranged for Python."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np

from . import _native
from ._errors import InputError, check_range, unknown
from ._native import Scenario
from ._progress import Progress, telling

if TYPE_CHECKING:
    import matplotlib.figure
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
    unguided : list of dict
        The stretches without guidance: ``from_s``, ``until_s`` (None: the guidance was not back in this run), ``lasts_s``,
        ``from_m``, ``to_m``, ``why``, and ``asked_for``: whether the scenario has it so, and it is not the ECU's own decision.
    said : list of (float, str, tuple of str)
        Mode and faults of the ECU: time in s, mode, names; from the start and at each change.
    k_hg : dict of str to numpy.ndarray
        K_hg as the ECU's telemetry has it, 50 times a second: ``time_s``, ``k_hg``, ``sd``; NaN where it is not identified.
    """

    scenario: Scenario
    columns: dict[str, np.ndarray] = field(repr=False)
    steps: int
    results: dict[str, Any] = field(repr=False)
    events: list[tuple[float, str]] = field(repr=False)
    bus: Optional[dict[str, np.ndarray]] = field(default=None, repr=False)
    unguided: list[dict[str, Any]] = field(default_factory=list)
    said: list[tuple[float, str, tuple[str, ...]]] = field(default_factory=list, repr=False)
    k_hg: dict[str, np.ndarray] = field(default_factory=dict, repr=False)

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.columns:
            raise unknown("columns of the run", name, self.columns)
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    @property
    def ending(self) -> str:
        """How it ended: ``"course-end"`` or ``"diverged"``."""
        return "diverged" if self.results["diverged"] else "course-end"

    @property
    def left_by_itself(self) -> bool:
        """Whether the ECU ended guidance by its own decision: then the metrics are not of guided driving alone."""
        return any(not stretch["asked_for"] for stretch in self.unguided)

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

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        """The columns for whatever reads the Arrow PyCapsule interface: pandas, Polars, DuckDB (needs pyarrow)."""
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def figure(self) -> matplotlib.figure.Figure:
        """Lateral error, torques and wheel angle over time (needs matplotlib)."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8, 7), layout="constrained")
        error, torque, wheel = figure.subplots(3, sharex=True)
        time_s = self["time_s"]
        error.plot(time_s, self["lateral_error_m"])
        error.set_ylabel("lateral error (m)")
        torque.plot(time_s, self["driver_torque_nm"], label="driver")
        torque.plot(time_s, self["guidance_torque_nm"], label="guidance")
        torque.set_ylabel("torque (N.m)")
        torque.legend()
        wheel.plot(time_s, self["wheel_angle_rad"])
        wheel.set(ylabel="wheel angle (rad)", xlabel="time (s)")
        failure_s = self.scenario.failure_time_s
        if failure_s is not None:
            for panel in (error, torque, wheel):
                panel.axvline(failure_s, color="black", linestyle=":")
        for stretch in self.unguided:
            from_s, label = stretch["from_s"], f"no guidance: {stretch['why']}"
            for panel in (error, torque, wheel):
                panel.axvspan(from_s, from_s + stretch["lasts_s"], color="#d55e00", alpha=0.2, label=label)
            torque.legend()
        return figure


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
    return Run(
        scenario,
        made["columns"],
        made["steps"],
        made["results"],
        made["events"],
        made.get("bus"),
        made["unguided"],
        made["said"],
        made["k_hg"],
    )


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
    progress: Progress = None,
) -> Evaluation:
    """Run the paper's evaluation: three drivers, four conditions, with and without failure.

    Parameters
    ----------
    scenario : Scenario, optional
        Gives course, speed, sensors, vehicle, guidance and the time of the failure.
    window_m : (float, float), optional
        Stretch to measure, m along the course.
    progress : bool or callable, optional
        True shows a bar (needs tqdm); a callable hears the number of runs done since it was last called.

    Returns
    -------
    Evaluation
    """
    window = None if window_m is None else list(window_m)
    with telling(progress, 30, "runs") as tell:
        made = _native.evaluate(Scenario() if scenario is None else scenario, window, tell)
    return Evaluation(made["results"], made["columns"])


@dataclass(frozen=True)
class Experiment:
    """The paper's participants, driven, identified and driven again.

    Attributes
    ----------
    results : dict
        What ``host-sim experiment --json`` prints: for each drive the truth, and what either method found.
    drives : list of dict of str to numpy.ndarray
        What was recorded of each drive, in the order of ``results["drives"]``; `identify` takes each.
    """

    results: dict[str, Any] = field(repr=False)
    drives: list[dict[str, np.ndarray]] = field(repr=False)

    def to_pandas(self) -> pandas.DataFrame:
        """One row for each drive: who, truth, and by the default method estimate and standard error (needs pandas)."""
        import pandas

        rows = []
        for drive in self.results["drives"]:
            found = drive["noise_model"]
            row = {"participant": drive["participant"], "guided": drive["guided"]}
            row.update({f"true_{name.lower()}": drive["truth"][name] for name in ("t_p", "k_d", "k_hg")})
            for name, parameter in found["parameters"].items():
                row[name], row[f"{name}_standard_error"] = parameter["estimate"], parameter["standard_error"]
            row["fit_percent"] = found["fit_percent"]
            row["trajectory_error_m"] = found["trajectory_error_m"]
            rows.append(row)
        return pandas.DataFrame(rows)


def experiment(
    participants: Sequence[int] = range(1, 15),
    *,
    probe_nm: float = 0.0,
    seed: int = 1,
    progress: Progress = None,
) -> Experiment:
    """Let the paper's participants drive as drivers with a known truth, identify them, and drive what was identified again.

    Parameters
    ----------
    participants : sequence of int, optional
        Numbers of tables 5 and 6, 1 to 14.
    probe_nm : float, optional
        Amplitude of the probe in the guided drives, N.m, 0 to 0.3; without it K_hg is hardly identified.
    seed : int, optional
        Of the torque that no model explains.
    progress : bool or callable, optional
        True shows a bar (needs tqdm); a callable hears the number of drives done since it was last called.

    Returns
    -------
    Experiment
        Of each participant a manual and a guided drive.

    Raises
    ------
    RangeError
        A number that is no participant's; a probe outside its range.
    """
    if isinstance(participants, (str, bytes)) or not all(
        isinstance(number, (int, np.integer)) for number in participants
    ):
        raise InputError(f"participants = {participants!r}: a list of whole numbers is wanted")
    numbers = [int(number) for number in participants]
    check_range("seed", seed, 0, 2**53, "")
    with telling(progress, 2 * len(numbers), "drives") as tell:
        made = _native.experiment(numbers, probe_nm, int(seed), tell)
    return Experiment(made["results"], made["drives"])


@dataclass(frozen=True)
class Comparison:
    """Every law against every driver.

    Attributes
    ----------
    results : dict
        What ``host-sim compare --json`` prints: means with intervals, law by law and driver by driver.
    drives : list of dict
        A row for each judged drive: law, driver, world, road, speed, seed, and every metric; None where it has none.
    """

    results: dict[str, Any] = field(repr=False)
    drives: list[dict[str, Any]] = field(repr=False)

    def to_pandas(self) -> pandas.DataFrame:
        """One row for each drive (needs pandas)."""
        import pandas

        return pandas.DataFrame(self.drives)


def compare(
    file: Union[str, os.PathLike[str]],
    *,
    laws: Optional[Mapping[str, Callable[..., Any]]] = None,
    drivers: Optional[Mapping[str, Callable[..., Any]]] = None,
    threads: Optional[int] = None,
    progress: Progress = None,
) -> Comparison:
    """Compare laws and drivers, with those of your own, as a file has them.

    Parameters
    ----------
    file : path
        A comparison file (TOML); ``kind`` may name a law or a driver of yours.
    laws : dict, optional
        Name and class of each law. An object has ``ask(view) -> float``: a `LawView` every millisecond, the torque in N.m.
    drivers : dict, optional
        Name and class of each driver. An object has ``step(view) -> float``, with a `DriverView`, and may have ``look_ahead_s``, a pair.
    threads : int, optional
        One a core if not given. Objects in Python take turns.
    progress : bool or callable, optional
        True shows a bar (needs tqdm); a callable hears the number of drives done since it was last called.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        A file that is wrong, by field, value and range.

    Notes
    -----
    A class may have ``parameters``, a dict of name to (default, least, largest), or with the two ends between which tuning varies it behind
    them. It is called with a keyword for each. Failures copy objects with `copy.deepcopy`.
    """
    for what, own in (("laws", laws), ("drivers", drivers)):
        for name, made_by in (own or {}).items():
            if not callable(made_by):
                raise InputError(f"{what}[{name!r}]: a {type(made_by).__name__} is no class")
    if threads is not None:
        check_range("threads", threads, 1, 4096, "")
    with telling(progress, None, "drives") as tell:
        made = _native.compare(file, dict(laws or {}), dict(drivers or {}), threads, tell)
    return Comparison(made["results"], made["drives"])
