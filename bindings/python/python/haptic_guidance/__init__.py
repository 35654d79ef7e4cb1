"""Haptic-guidance steering: the closed loop, driver identification, and the shipping ECU.

The controller, the models and the estimators are those of the command line `host-sim`, bit for bit. Names bear their
units, signs are those of ISO 8855: left is positive.

Examples
--------
>>> import haptic_guidance as hg
>>> run = hg.simulate(hg.Scenario(condition="high", failure={"kind": "torque"}))
>>> run.ending
'course-end'
"""

from ._errors import InputError, RangeError, UnknownNameError
from ._identify import Change, Fit, Parameter, Piece, identify
from ._native import (
    INPUT_IDS,
    Action,
    Bus,
    DriverView,
    Ecu,
    Frame,
    LawView,
    Outcome,
    Scenario,
    Simulation,
    Step,
    __version__,
    metric_definitions,
    parameters,
)
from ._results import Comparison, Evaluation, Experiment, Run, compare, evaluate, experiment, simulate
from ._sweep import SweepResult, sweep

__all__ = [
    "INPUT_IDS",
    "Action",
    "Bus",
    "DriverView",
    "Ecu",
    "Evaluation",
    "Experiment",
    "Change",
    "Comparison",
    "Fit",
    "Frame",
    "InputError",
    "LawView",
    "Outcome",
    "Parameter",
    "Piece",
    "RangeError",
    "Run",
    "Scenario",
    "Simulation",
    "Step",
    "SweepResult",
    "UnknownNameError",
    "__version__",
    "compare",
    "evaluate",
    "experiment",
    "identify",
    "metric_definitions",
    "parameters",
    "simulate",
    "sweep",
]
