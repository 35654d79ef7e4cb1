"""The FMUs, checked by FMPy, those of FMI 2.0 and of FMI 3.0: their descriptions are valid; the controller gives the torques
of the library for the same samples, bit for bit; a state can be taken, written, read by another unit and given back; what is
refused leaves everything as it was; controller, driver and vehicle coupled drive as `host-sim run` does, on any road and through a
torsion bar.

    check.py DIRECTORY RUN_CSV
"""

import contextlib
import csv
import io
import shutil
import sys
from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import haptic_guidance as hg

MODELS = ("HapticController", "HapticDriver", "HapticVehicle")
INPUTS = ("e_y_m", "e_theta_rad", "driver_torque_nm", "wheel_angle_rad", "motor_torque_nm", "speed_m_per_s")
STEPS = 5000
# The worst that coupling by held values may cost, m.
WITHIN_M = 1e-3


class Unit:
    """One FMU of either standard, by names."""

    def __init__(self, path, resource=None, **parameters):
        description = read_model_description(path)
        self.variables = description.modelVariables
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.new = description.fmiVersion.startswith("3")
        arguments = dict(
            guid=description.guid,
            unzipDirectory=unpacked(path, resource),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=description.modelName,
        )
        self.fmu = (FMU3Slave if self.new else FMU2Slave)(**arguments)
        self.fmu.instantiate()
        for name, value in parameters.items():
            how = {bool: self.turn, str: self.say}.get(type(value), self.put)
            how(**{name: value})
        if not self.new:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def get(self, *names):
        get = self.fmu.getFloat64 if self.new else self.fmu.getReal
        return get([self.references[name] for name in names])

    def code(self, name):
        return (self.fmu.getInt32 if self.new else self.fmu.getInteger)([self.references[name]])[0]

    def put(self, **values):
        put = self.fmu.setFloat64 if self.new else self.fmu.setReal
        put([self.references[name] for name in values], list(values.values()))

    def turn(self, **values):
        self.fmu.setBoolean([self.references[name] for name in values], list(values.values()))

    def say(self, **values):
        self.fmu.setString([self.references[name] for name in values], list(values.values()))

    def text(self, name):
        (text,) = self.fmu.getString([self.references[name]])
        return text if self.new else text.decode()

    def outputs(self):
        """Every output, whatever its type."""
        of = lambda types: [v.name for v in self.variables if v.causality == "output" and v.type in types]
        codes = [self.code(name) for name in of(("Integer", "Int32"))]
        flags = [self.fmu.getBoolean([self.references[name]])[0] for name in of(("Boolean",))]
        return self.get(*of(("Real", "Float64"))) + codes + flags

    def step(self, k, step_s=1e-3):
        self.fmu.doStep(k * 1e-3, step_s)

    def state(self):
        return self.fmu.getFMUState()

    def go_to(self, state):
        self.fmu.setFMUState(state)
        self.fmu.freeFMUState(state)

    def end(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


def unpacked(path, resource):
    """The folder of a unit, with a file of somebody's own in its resources."""
    folder = Path(extract(path))
    if resource is not None:
        (folder / "resources").mkdir()
        shutil.copy(resource, folder / "resources")
    return str(folder)


def refused(call):
    """Why a unit refuses, by its log; nothing if it does not."""
    log = io.StringIO()
    try:
        with contextlib.redirect_stdout(log):
            call()
    except Exception as error:
        return log.getvalue().strip() or repr(error)
    return ""


def samples():
    """A target that sways, a probing hand, a camera and a motor that obey."""
    t = np.arange(STEPS) * 1e-3
    e_y, e_theta = 0.1 * np.sin(2 * t), 0.004 * np.cos(2 * t)
    return zip(e_y, e_theta, 0.1 * np.sin(5 * t), 0.005 * np.sin(5 * t))


def controller(path):
    unit = Unit(path)
    ecu, bus = hg.Ecu(), hg.Bus()
    torque_nm, modes, differing = 0.0, set(), 0
    for k, (e_y, e_theta, driver, wheel) in enumerate(samples()):
        engage = k >= 600
        values = dict(zip(INPUTS, (e_y, e_theta, driver, wheel, torque_nm, 16.5)))
        for frame in bus.frames(1000 * k, **values, engage=engage):
            ecu.receive(*frame, 1000 * k)
        unit.put(**values)
        unit.turn(engage=engage)
        unit.step(k)
        torque_nm = ecu.step(1000 * k).torque_nm
        differing += unit.get("torque_nm")[0] != torque_nm
        modes.add(unit.code("mode"))
        if k == STEPS // 2:
            state, then = unit.state(), unit.get("torque_nm")
    assert differing == 0 and modes >= {1, 2}, (differing, modes)
    unit.go_to(state)
    assert unit.get("torque_nm") == then
    before = unit.get(*INPUTS)
    assert refused(lambda: unit.put(e_y_m=0.05, e_theta_rad=float("nan")))
    assert refused(lambda: unit.step(0, 0.0005)), "no multiple of 1 ms"
    assert refused(lambda: unit.put(k_1=0.3)), "a parameter while the unit guides"
    assert refused(lambda: unit.turn(engaged_at_start=True)), "a fixed parameter after the start"
    assert refused(lambda: unit.put(torque_nm=1.0)), "an output"
    assert refused(lambda: unit.turn(e_y_m=True)), "another type"
    assert unit.get(*INPUTS) == before and unit.get("torque_nm") == then
    unit.end()
    return differing


def tuned(path):
    """Parameters set in Standby: from there on the torques of the library's ECU that starts with them at that instant."""
    description = read_model_description(path)
    parameters = {p["name"] for p in hg.parameters()}
    tunable = {v.name for v in description.modelVariables if v.variability == "tunable"}
    assert tunable == parameters and all(v.causality == "parameter" for v in description.modelVariables if v.name in tunable)
    unit, start = Unit(path), 1000
    ecu, bus = hg.Ecu({"k_1": 0.2, "torque_limit_nm": 2.0}, t_us=1000 * start), hg.Bus()
    torque_nm, largest = 0.0, 0.0
    for k, (e_y, e_theta, driver, wheel) in enumerate(samples()):
        if k == start:
            assert unit.code("mode") == 1, "Standby"
            before = unit.get("k_1", "a_1", "torque_limit_nm")
            # A value, a product of two that the ECU refuses, a value behind a good one, no number.
            for bad in (dict(k_1=5.0), dict(k_1=4.0, a_1=100.0), dict(k_1=0.2, torque_limit_nm=6.0), dict(a_1=float("nan"))):
                assert refused(lambda: unit.put(**bad)), bad
                assert unit.get("k_1", "a_1", "torque_limit_nm") == before, bad
            unit.put(k_1=0.2, torque_limit_nm=2.0)
        values = dict(zip(INPUTS, (e_y, e_theta, driver, wheel, torque_nm, 16.5)))
        unit.put(**values)
        unit.turn(engage=k >= start + 600)
        unit.step(k)
        if k >= start:
            for frame in bus.frames(1000 * k, **values, engage=k >= start + 600):
                ecu.receive(*frame, 1000 * k)
            torque_nm = ecu.step(1000 * k).torque_nm
            assert unit.get("torque_nm")[0] == torque_nm, k
            largest = max(largest, abs(torque_nm))
    assert unit.code("mode") == 2 and largest > 0.05, "it guided"
    torque = unit.get("torque_nm")
    assert refused(lambda: unit.put(k_1=0.1)) and unit.get("k_1") == [0.2] and unit.get("torque_nm") == torque
    unit.end()
    return len(tunable)


def unguided(path):
    """The request goes for a second and comes again, then the speed sensor jumps: the causes in turn, step by step with the mode."""
    unit, away, causes = Unit(path, engaged_at_start=True), 0, []
    for k, (e_y, e_theta, driver, wheel) in enumerate(samples()):
        speed = 16.5 if k < 3000 else 3.0
        unit.put(**dict(zip(INPUTS, (e_y, e_theta, driver, wheel, unit.get("torque_nm")[0], speed))))
        unit.turn(engage=not 500 <= k < 1500)
        unit.step(k)
        mode, cause = unit.code("mode"), unit.code("unguided_cause")
        assert (cause == 0) == (mode == 2), (k, mode, cause)
        away += mode != 2
        assert abs(unit.get("unguided_s")[0] - away * 1e-3) < 1e-9
        if causes[-1:] != [cause]:
            causes.append(cause)
    unit.end()
    # -3: the request ended; bit 16 of the fault word: SpeedStep.
    assert causes == [0, -3, 0, 1 << 16], causes
    return away


def bounds(path):
    """Every input has a range; beyond it, and for no number, the unit says name, value and range, and stays as it was."""
    unit, checked = Unit(path), 0
    for variable in unit.variables:
        if variable.causality != "input" or variable.type not in ("Real", "Float64"):
            continue
        name, low, high = variable.name, float(variable.min), float(variable.max)
        before = unit.get(name)
        for value in (low - 1e-3 * (high - low), high + 1e-3 * (high - low), 1e30, float("inf"), float("nan")):
            why = refused(lambda: unit.put(**{name: value}))
            assert f"{name} = " in why and ("is outside" in why or "no finite" in why), (name, why)
            assert unit.get(name) == before
        for value in (low, high, before[0]):
            unit.put(**{name: value})
        checked += 1
    unit.end()
    return checked


def default_driver(path):
    """A unit that nobody told anything is the driver of a scenario that says nothing."""
    unit, scenario = Unit(path), hg.Scenario()
    assert unit.get("k_d_nm_per_rad", "k_hg", "t_p_s") == [scenario.k_d, scenario.k_hg, scenario.t_p_s]
    unit.end()


def written(path, other):
    """A state that is written and read by a unit of its own goes on as the original, bit for bit; other bytes are refused."""
    inputs = [v for v in read_model_description(path).modelVariables if v.causality == "input"]

    def drive(unit, steps):
        told = []
        for k in steps:
            if k == 700 and "k_1" in unit.references:
                # In Standby, twice the same: the ECU begins anew each time.
                unit.put(k_1=0.2, torque_limit_nm=2.0)
            if k % 3 == 0:
                for i, v in enumerate(inputs):
                    if v.type == "Boolean":
                        unit.turn(**{v.name: k >= 1500})
                    elif v.name == "speed_m_per_s":
                        unit.put(**{v.name: 16.5})
                    else:
                        unit.put(**{v.name: 0.004 * np.sin(0.002 * k + i) if v.name != "authority" else 0.9})
            unit.step(k)
            told.append(unit.outputs())
        return told

    def of(unit, state):
        return unit.fmu.serializeFMUState(state)

    unit = Unit(path)
    drive(unit, range(2500))
    # Set and not yet stepped through.
    unit.put(**{inputs[0].name: 0.001})
    state = unit.state()
    kept = of(unit, state)
    again = Unit(path)
    assert not refused(lambda: again.go_to(again.fmu.deserializeFMUState(kept)))
    assert again.get(inputs[0].name) == [0.001] and again.outputs() == unit.outputs()
    mine = again.state()
    assert of(again, mine) == kept, "it can be written again"
    again.fmu.freeFMUState(mine)
    expected, got = drive(unit, range(2500, 4000)), drive(again, range(2500, 4000))
    assert expected == got and np.ptp(np.array(expected), axis=0).max() > 0
    # Before the start there is a state too.
    fresh = Unit(path)
    fresh.fmu.reset()
    young = fresh.state()
    fresh.go_to(fresh.fmu.deserializeFMUState(of(fresh, young)))
    fresh.fmu.freeFMUState(young)
    assert "before the end of the initialization" in refused(lambda: fresh.step(0))
    # Nothing but what such a unit wrote; the unit stays as it was.
    before = again.outputs()
    stranger = Unit(other)
    assert "not a state" in refused(lambda: stranger.fmu.deserializeFMUState(kept))
    for wrong in (b"", kept[:50], kept[:-1], kept[: len(kept) // 2], kept + b"\0"):
        assert refused(lambda: again.fmu.deserializeFMUState(wrong))
    for place in range(0, len(kept), max(1, len(kept) // 200)):
        bytes_ = bytearray(kept)
        bytes_[place] ^= 0x41
        # Refused or not: another state, no crash.
        refused(lambda: again.fmu.deserializeFMUState(bytes(bytes_)))
    assert again.outputs() == before
    for each in (unit, again, fresh, stranger):
        each.end()
    return len(kept)


def too_long(path):
    """After ten hours a state can be taken, and no longer written: what would be written has to be driven again."""
    unit = Unit(path)
    for hour in range(11):
        unit.step(3600_000 * hour, 3600.0)
    state = unit.state()
    assert "the drive is too long" in refused(lambda: unit.fmu.serializeFMUState(state))
    unit.go_to(state)
    unit.end()


def roads(directory, ending):
    """The vehicle drives on a road of the user's: a path, a file in the unit's resources, OpenDRIVE."""
    path = directory / f"HapticVehicle.{ending}"
    hill = Path("examples/hill-road.toml").resolve()
    unit = Unit(path)
    assert unit.text("course") == "paper-course"
    assert "course cannot be set now" in refused(lambda: unit.say(course=str(hill)))
    unit.end()
    errors = []
    for place in (dict(course=str(hill)), dict(course=hill.name, resource=hill)):
        errors.append(coupled(directory, ending, 60.0, **place))
    assert np.array_equal(*errors)
    run = hg.simulate(hg.Scenario(course=hill, driver={"t_p_s": 0.3}))
    rows = len(errors[0])
    apart = np.abs(errors[0] - run["lateral_error_m"][:rows]).max()
    assert apart < WITHIN_M < 0.1 * np.abs(run["lateral_error_m"][:rows]).max(), apart
    Unit(path, course=str(Path("tests/data/xodr/chain.xodr").resolve())).end()
    for wrong in ("no-such.toml", "/no/such.xodr", str(Path("core/haptic.dbc").resolve())):
        why = refused(lambda: Unit(path, course=wrong))
        assert "course = " in why and Path(wrong).name in why, why
    return apart


def coupled(directory, ending, until_s, **road):
    """Lateral errors every 5 ms of the three, each step under what the others had at its start."""
    path = lambda model: directory / f"{model}.{ending}"
    vehicle = Unit(path("HapticVehicle"), **road)
    driver = Unit(path("HapticDriver"), **DRIVER)
    guidance = Unit(path("HapticController"), engaged_at_start=True)
    guidance.turn(engage=True)
    errors, half = [], None
    for k in range(int(until_s * 1000)):
        seen = vehicle.get(
            "e_y_m", "e_theta_rad", "guidance_e_y_m", "guidance_e_theta_rad", "wheel_angle_rad", "column_torque_nm",
            "motor_torque_nm", "speed_m_per_s", "lateral_error_m",
        )
        e_y, e_theta, near, far, wheel, column, motor, speed, lateral = seen
        if k % 5 == 0:
            errors.append(lateral)
        torque = guidance.get("torque_nm")[0]
        guidance.put(
            e_y_m=near, e_theta_rad=far, driver_torque_nm=column, wheel_angle_rad=wheel, motor_torque_nm=motor,
            speed_m_per_s=speed,
        )
        driver.put(e_y_m=e_y, e_theta_rad=e_theta, wheel_angle_rad=wheel, guidance_torque_nm=torque)
        vehicle.put(driver_torque_nm=driver.get("driver_torque_nm")[0], guidance_torque_nm=torque)
        for unit in (guidance, driver, vehicle):
            unit.step(k)
        if k == 2000 and not road:
            half = [(unit, unit.state(), unit.get("time")[0] if unit.new else None) for unit in (vehicle, driver, guidance)]
    if half is None:
        return np.array(errors)
    after = [vehicle.get("e_y_m")[0], driver.get("driver_torque_nm")[0]]
    for unit, state, time in half:
        unit.go_to(state)
        assert time is None or unit.get("time")[0] == time == 2.001
    assert [vehicle.get("e_y_m")[0], driver.get("driver_torque_nm")[0]] != after
    assert refused(lambda: vehicle.step(0, 3600.0)), "past the end of the course"
    for unit in (vehicle, driver, guidance):
        unit.end()
    return np.array(errors)


def through_a_bar(directory, ending):
    """The three with a torsion bar drive as the library, to the bit: the driver's torque is of the step before, the guidance's of this one.
    Files without a bar, and of no column, are refused."""
    path = lambda model: directory / f"{model}.{ending}"
    example = Path("examples/torsion-bar.toml").resolve()
    scenario = hg.Scenario.load(example)
    told = {name: float(value) for name, value in scenario.to_dict()["guidance"].items() if name in BAR}
    assert set(told) == set(BAR) and told["torque_sensor"] == 1
    vehicle = Unit(path("HapticVehicle"), column=str(example))
    driver = Unit(path("HapticDriver"), t_p_s=scenario.t_p_s, k_d_nm_per_rad=scenario.k_d, k_hg=scenario.k_hg)
    guidance = Unit(path("HapticController"), engaged_at_start=True, **told)
    guidance.turn(engage=True)
    run = hg.simulate(scenario)
    names = ("lateral_error_m", "driver_torque_nm", "guidance_torque_nm", "wheel_angle_rad")
    differing, apart = 0, 0.0
    for k in range(105_000):
        seen = vehicle.get(
            "e_y_m", "e_theta_rad", "guidance_e_y_m", "guidance_e_theta_rad", "wheel_angle_rad", "felt_torque_nm", "told_angle_rad",
            "column_torque_nm", "motor_torque_nm", "speed_m_per_s", "lateral_error_m",
        )
        e_y, e_theta, near, far, wheel, felt, angle, column, motor, speed, lateral = seen
        guidance.put(
            e_y_m=near, e_theta_rad=far, driver_torque_nm=column, wheel_angle_rad=angle, motor_torque_nm=motor, speed_m_per_s=speed,
        )
        guidance.step(k)
        hands, torque = driver.get("driver_torque_nm")[0], guidance.get("torque_nm")[0]
        driver.put(e_y_m=e_y, e_theta_rad=e_theta, wheel_angle_rad=wheel, guidance_torque_nm=felt)
        vehicle.put(driver_torque_nm=hands, guidance_torque_nm=torque)
        driver.step(k)
        vehicle.step(k)
        if k % 5 == 0:
            differing += (lateral, hands, torque, wheel) != tuple(run[name][k // 5] for name in names)
            apart = max(apart, abs(angle - wheel))
    assert differing == 0 and apart > 1e-3, (differing, apart)
    for unit in (vehicle, driver, guidance):
        unit.end()
    for wrong, said in (("examples/relying-driver.toml", "torsion-bar"), ("core/haptic.dbc", "TOML"), ("no-such.toml", "No such file")):
        why = refused(lambda: Unit(path("HapticVehicle"), column=str(Path(wrong).resolve())))
        assert "column = " in why and Path(wrong).name in why and said in why, why
    return apart


def main(directory, run_csv):
    tokens = {read_model_description(directory / f"{model}.fmu").guid for model in MODELS}
    assert len(tokens) == len(MODELS), "a token tells which model of the binary it is"
    for ending in ("fmu", "fmi3.fmu"):
        for model in MODELS:
            problems = validate_fmu(str(directory / f"{model}.{ending}"))
            assert not problems, (model, ending, problems)
        differing = controller(directory / f"HapticController.{ending}")
        print(f"{ending}: {tuned(directory / f'HapticController.{ending}')} parameters tunable in Standby, with the library's torques")
        paths = [directory / f"{model}.{ending}" for model in MODELS]
        print(f"{ending}: {unguided(paths[0])} steps without guidance, with why")
        default_driver(paths[1])
        too_long(paths[1])
        sizes = [written(path, paths[i - 1]) for i, path in enumerate(paths)]
        print(f"{ending}: {sum(bounds(path) for path in paths)} inputs have ranges; 2.5 s of states are {', '.join(map(str, sizes))} "
              "bytes, and other units go on from them with the same bits")
        print(f"{ending}: roads of one's own: {roads(directory, ending) * 1e3:.3f} mm from the library's drive on hill-road.toml")
        print(f"{ending}: through examples/torsion-bar.toml: 105 s to the bit as the library; wheel and column up to "
              f"{through_a_bar(directory, ending) * 1e3:.1f} mrad apart")
        print(f"{ending}: fmpy validate: no problem in {', '.join(MODELS)}; controller: {STEPS} torques, {differing} differ "
              "from the library's; state and refusals hold")
    with open(run_csv) as file:
        rows = list(csv.DictReader(file))
    expected = np.array([float(row["lateral_error_m"]) for row in rows])
    # The first bend, into it and out of it.
    until_s = min(105.0, float(rows[-1]["time_s"]))
    runs = [coupled(directory, ending, until_s) for ending in ("fmu", "fmi3.fmu")]
    assert np.array_equal(*runs), "FMI 2.0 and 3.0 differ"
    rows = min(len(runs[0]), len(expected))
    apart = np.abs(runs[0][:rows] - expected[:rows])
    print(f"coupled: {rows / 200:.1f} s, lateral error at most {apart.max() * 1e3:.3f} mm from host-sim's, which reaches "
          f"{np.abs(expected).max() * 1e3:.1f} mm; FMI 2.0 and 3.0 the same bits")
    assert apart.max() < WITHIN_M and rows / 200 > 60


# Those of the scenario of `cargo xtask fmu`.
DRIVER = dict(t_p_s=0.3, k_d_nm_per_rad=3.0, k_hg=0.5)
# What the ECU is told of a bar.
BAR = ("torque_sensor", "wheel_inertia_kg_m2", "wheel_friction_nm", "bar_stiffness_nm_per_rad")

if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
