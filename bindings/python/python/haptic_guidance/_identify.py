"""Identification of a recorded drive."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Optional, Union

import numpy as np

from . import _native
from ._errors import InputError, unknown
from ._native import Scenario
from ._results import Run


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
class Piece:
    """A stretch of a drive with one driver.

    Attributes
    ----------
    from_s, to_s : float
        Where it begins and ends.
    parameters : dict of str to Parameter
        As those of a `Fit`. ``piece["k_hg"]`` is short for one.
    results : dict
        All that was found in it.
    """

    from_s: float
    to_s: float
    parameters: dict[str, Parameter]
    results: dict[str, Any] = field(repr=False)

    def __getitem__(self, name: str) -> Parameter:
        if name not in self.parameters:
            raise unknown("parameters of the driver", name, self.parameters)
        return self.parameters[name]


@dataclass(frozen=True)
class Change:
    """A change of the driver.

    Attributes
    ----------
    parameter : str
        What changed most: ``k_hg``, ``t_p``, or ``k_d``, all gains by one factor.
    at_s : (float, float)
        First and last instant; the same for a step.
    at_95_s : ((float, float), (float, float))
        95 % intervals of these.
    by : float
        By how much; of ``k_d`` the share of the gains.
    deviance : float
        What the change adds to twice the log likelihood.
    """

    parameter: str
    at_s: tuple[float, float]
    at_95_s: tuple[tuple[float, float], tuple[float, float]]
    by: float
    deviance: float


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
    pieces : list of Piece
        The driver between one change and the next, if asked for.
    changes : list of Change
        What lies between them.
    """

    parameters: dict[str, Parameter]
    results: dict[str, Any] = field(repr=False)
    traces: dict[str, np.ndarray] = field(repr=False)
    pieces: list[Piece] = field(default_factory=list)
    changes: list[Change] = field(default_factory=list)

    def __getitem__(self, name: str) -> Parameter:
        if name not in self.parameters:
            raise unknown("parameters of the driver", name, self.parameters)
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
    def reading(self) -> list[tuple[str, str, str]]:
        """What was left out, merged, cut, mended, guessed or converted when the drive was read: what, found, done."""
        preflight = self.results["preflight"] or {"reading": []}
        return [tuple(row) for row in preflight["reading"]]

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


#: A recorded drive.
Drive = Union[str, "os.PathLike[str]", Mapping[str, Any], Run]


def identify(
    drive: Drive,
    *,
    also: Sequence[Drive] = (),
    manual: bool = False,
    assisted: bool = False,
    fix: Optional[Mapping[str, float]] = None,
    estimate: Optional[Mapping[str, Optional[tuple[float, float]]]] = None,
    between_s: Sequence[tuple[float, float]] = (),
    as_published: bool = False,
    pieces: bool = False,
    max_gap: float = 0.3,
    preprocessing: bool = True,
    lane_smoothing: bool = True,
    map: Optional[Mapping[str, str]] = None,
    time: Optional[str] = None,
    layout: Union[str, os.PathLike[str], None] = None,
    dbc: Union[str, os.PathLike[str], None] = None,
    bus: Optional[str] = None,
    vehicle: Optional[Scenario] = None,
) -> Fit:
    """Identify the driver of a recorded drive.

    Parameters
    ----------
    drive : path, mapping or Run
        A CSV, Parquet, MAT or MDF 4 file, a recording of the bus (candump, ASC, BLF); columns by name (a DataFrame is a
        mapping too); or a run.
        Needed are ``time_s``, ``e_y_m``, ``e_theta_rad``, ``wheel_angle_rad``, ``guidance_torque_nm`` and
        ``driver_torque_nm``. Where the speed changes, ``speed_m_per_s`` says so.
    also : sequence of drives, optional
        More drives of the same driver, of the same rate: all are one fit.
    manual : bool, optional
        A drive without guidance: K_hg is no part of the model.
    assisted : bool, optional
        The column has a power assist that is not in ``guidance_torque_nm``: it turns the wheel with the driver, so that no scale of
        ``driver_torque_nm`` below 1 is refuted.
    fix : mapping of str to float, optional
        Parameters that are known, such as ``{"k_nms": 1.0}``.
    estimate : mapping of str to (float, float) or None, optional
        What else to estimate, with its range or None for the widest: ``k_nms``, ``t_nms``, ``t_h_late``, ``t_d_late``.
    between_s : sequence of (float, float), optional
        Stretches of the drive to use, s; all of it if not given.
    as_published : bool, optional
        The paper's method instead of prediction errors with a noise model.
    pieces : bool, optional
        Find when the driver changed, and fit each stretch between two changes as a driver of its own.
    max_gap : float, optional
        Pauses of a signal (lost rows, NaN, a stuck sensor) up to so long are bridged, s, 0 to 1; longer ones cut the drive.
    preprocessing : bool, optional
        False uses every row: hands off, standstill and lane changes are not looked for.
    lane_smoothing : bool, optional
        False takes the lane signals as they are: no camera noise is estimated and removed.
    map : mapping of str to str, optional
        Columns of another name or unit, such as ``{"wheel_angle_rad": "SteeringAngle*0.0174533"}`` or
        ``{"speed_m_per_s": "Speed [km/h]"}``. Without unit and factor the unit is converted if the file or the name says it.
    time : str, optional
        The channel that is the time, if it is not ``time_s``, with a unit or a factor as in `map`.
    layout : str or path, optional
        Whose recording the file is: ``"openlka"``, ``"openpilot"``, ``"sadc"``, ``"udacity"``, ``"cognitive-driver-model"``, or a
        layout of one's own (``.toml``). Of a drive that an automation shares in turns, `manual` takes the stretches by hand,
        otherwise the others are taken.
    dbc : path, optional
        What the frames of a recording of the bus mean, if it is not the product's own bus.
    bus : str, optional
        The bus of a recording of several, by its name there: an interface (``"can0"``) or the number of a channel.
    vehicle : Scenario, optional
        The vehicle of a recording of the bus, if not that of table 9. The bus does not carry the driver's far point; it is
        computed with this vehicle.

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
    maps = dict(map or {})
    if time is not None and maps.setdefault("time_s", time) != time:
        raise InputError("time: map names time_s too")
    if isinstance(also, (str, os.PathLike, Mapping, Run)):
        raise InputError("also: a list of drives is wanted")
    if also and as_published:
        raise InputError("also: the published method takes one drive")
    if pieces and (also or as_published):
        raise InputError("pieces: one drive and no as_published is wanted")
    drives = [drive, *also]
    files = [isinstance(each, (str, os.PathLike)) for each in drives]
    for name, given in (("dbc", dbc), ("bus", bus), ("vehicle", vehicle)):
        if given is not None and not all(files):
            raise InputError(f"{name}: only for a recording of the bus; columns need none")
    if layout is not None and not all(files):
        raise InputError("layout: only for a file; columns are named by map")
    how = dict(
        manual=manual,
        assisted=assisted,
        fix=fixed,
        estimate=wanted,
        between=[list(stretch) for stretch in between_s],
        as_published=as_published,
        pieces=pieces,
        max_gap=max_gap,
        preprocessing=preprocessing,
        lane_smoothing=lane_smoothing,
        maps=[f"{name}={channel}" for name, channel in maps.items()],
        layout=None if layout is None else os.fspath(layout),
        dbc=None if dbc is None else os.fspath(dbc),
        bus=bus,
        vehicle=vehicle,
    )
    given = [os.fspath(each) if file else _columns(each) for each, file in zip(drives, files)]
    made = _native.identify(given, how)
    found = made["pieces"] or {"pieces": [], "changes": []}
    return Fit(
        _parameters(made["results"], made["units"]),
        made["results"],
        made["traces"],
        [Piece(each["from_s"], each["to_s"], _parameters(each, made["units"]), each) for each in found["pieces"]],
        [
            Change(
                parameter=each["parameter"],
                at_s=tuple(each["at_s"]),
                at_95_s=tuple(tuple(ends) for ends in each["at_95_s"]),
                by=each["by"],
                deviance=each["deviance"],
            )
            for each in found["changes"]
        ],
    )


def _parameters(results: Mapping[str, Any], units: Mapping[str, str]) -> dict[str, Parameter]:
    """The parameters of one driver."""
    parameters = {}
    for name, unit in units.items():
        found = dict(results["parameters"][name])
        interval = found.pop("interval_95")
        parameters[name] = Parameter(
            name=name, unit=unit, interval_95=None if interval is None else tuple(interval), **found
        )
    return parameters


def _columns(drive: Any) -> dict[str, np.ndarray]:
    """The columns of a run or of a mapping."""
    table = drive.columns if isinstance(drive, Run) else drive
    columns = {str(name): _column(name, table[name]) for name in table.keys()}
    return {name: column for name, column in columns.items() if column is not None}


def _column(name: Any, values: Any) -> Optional[np.ndarray]:
    """A column as float64; None for one that is no numbers, which the estimator may not need."""
    try:
        column = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if column.ndim != 1:
        raise InputError(f"{name}: {column.ndim} dimensions, one is wanted")
    return column

