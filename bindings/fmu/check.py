"""The FMU, checked by FMPy: its description is valid, it gives the torques of the library for the same samples, bit for
bit, its state can be taken and given back, and what it refuses leaves it as it was.

    check.py FMU
"""

import sys

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

import haptic_guidance as hg

INPUTS = ("e_y_m", "e_theta_rad", "driver_torque_nm", "wheel_angle_rad", "motor_torque_nm", "speed_m_per_s")
STEPS = 5000


def samples():
    """A target that sways, a probing hand, a camera and a motor that obey."""
    t = np.arange(STEPS) * 1e-3
    e_y, e_theta = 0.1 * np.sin(2 * t), 0.004 * np.cos(2 * t)
    return zip(e_y, e_theta, 0.1 * np.sin(5 * t), 0.005 * np.sin(5 * t))


def begin(fmu):
    description = read_model_description(fmu)
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    unit = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(fmu),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="controller",
    )
    unit.instantiate()
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    return unit, references


def refused(call):
    try:
        call()
    except Exception as error:
        return "fmi2Error" in str(error) or "status 3" in str(error)
    return False


def main(fmu):
    problems = validate_fmu(fmu)
    assert not problems, problems
    unit, references = begin(fmu)
    reals = [references[name] for name in INPUTS]
    torque = [references["torque_nm"]]
    ecu, bus = hg.Ecu(), hg.Bus()
    torque_nm, modes, differing = 0.0, set(), 0
    for k, (e_y, e_theta, driver, wheel) in enumerate(samples()):
        engage = k >= 600
        values = dict(zip(INPUTS, (e_y, e_theta, driver, wheel, torque_nm, 16.5)))
        for frame in bus.frames(1000 * k, **values, engage=engage):
            ecu.receive(*frame, 1000 * k)
        unit.setReal(reals, list(values.values()))
        unit.setBoolean([references["engage"]], [engage])
        unit.doStep(k * 1e-3, 1e-3)
        torque_nm = ecu.step(1000 * k).torque_nm
        differing += unit.getReal(torque)[0] != torque_nm
        modes.add(unit.getInteger([references["mode"]])[0])
        if k == STEPS // 2:
            state, then = unit.getFMUState(), unit.getReal(torque)
    assert differing == 0 and modes >= {1, 2}, (differing, modes)
    unit.setFMUState(state)
    assert unit.getReal(torque) == then
    unit.freeFMUState(state)
    before = unit.getReal(reals)
    assert refused(lambda: unit.setReal(reals[:2], [0.05, float("nan")]))
    assert refused(lambda: unit.doStep(0.0, 0.0005)), "no multiple of 1 ms"
    assert refused(lambda: unit.setReal([references["k_1"]], [0.3])), "a parameter after the start"
    assert unit.getReal(reals) == before and unit.getReal(torque) == then
    unit.terminate()
    unit.freeInstance()
    print(f"fmpy validate: no problem; {STEPS} torques, {differing} differ from the library's; state and refusals hold")


main(sys.argv[1])
