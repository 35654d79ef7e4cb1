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
    Outcome,
    Scenario,
    Simulation,
    Step,
    metric_definitions,
    parameters,
)
from ._results import Evaluation, Experiment, Run, evaluate, experiment, simulate
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
    "Fit",
    "Frame",
    "InputError",
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
    "evaluate",
    "experiment",
    "identify",
    "metric_definitions",
    "parameters",
    "simulate",
    "sweep",
]
