"""The shipping ECU and the senders on its bus."""

import copy
import pickle

import pytest

import haptic_guidance as hg

SHORT = {"segment": [{"length_m": 300.0}, {"length_m": 200.0, "curvature_per_m": 0.002}]}


def settled(engage_at_ms=600, duration_ms=900, **values):
    """An ECU on a quiet bus; returns it with its bus and its last step."""
    ecu, bus = hg.Ecu(), hg.Bus()
    for k in range(duration_ms):
        inputs = dict(
            e_y_m=0.0,
            e_theta_rad=0.0,
            driver_torque_nm=0.0,
            wheel_angle_rad=0.0,
            motor_torque_nm=0.0,
            speed_m_per_s=16.7,
            engage=k >= engage_at_ms,
        )
        for frame in bus.frames(1000 * k, **{**inputs, **values}):
            ecu.receive(*frame, 1000 * k)
        step = ecu.step(1000 * k)
    return ecu, bus, step


def test_the_frames_of_a_run_give_its_answers_bit_for_bit():
    run = hg.simulate(hg.Scenario(course=SHORT, condition="high", guidance={"probe": True}), bus=True)
    ecu, inputs = hg.Ecu(run.scenario, engaged=True), {0x100, 0x110, 0x120, 0x130}
    assert inputs <= hg.INPUT_IDS
    sent = [(int(t), int(i), bytes(d)) for t, i, d in zip(run.bus["t_us"], run.bus["id"], run.bus["data"])]
    by_step = {}
    for t_us, id, data in sent:
        by_step.setdefault(t_us, []).append((id, data))
    answers = 0
    for t_us, frames in by_step.items():
        for id, data in frames:
            if id in inputs:
                assert ecu.receive(id, data, t_us) is None
        expected = [frame for frame in frames if frame[0] not in inputs]
        assert [tuple(frame) for frame in ecu.step(t_us).frames] == expected, t_us
        answers += len(expected)
    assert answers > run.steps


def test_an_ecu_boots_and_engages_on_a_rise_of_the_request():
    assert settled(engage_at_ms=10_000)[2].mode == "Standby"
    assert settled()[2].mode == "Active"
    # A request that was there from the start is no rise.
    assert settled(engage_at_ms=0)[2].mode == "Standby"


def test_guidance_turns_towards_the_target():
    left = settled(duration_ms=700, e_y_m=0.2)[2]
    right = settled(duration_ms=700, e_y_m=-0.2)[2]
    assert left.torque_nm > 0.05 and right.torque_nm == -left.torque_nm
    assert left.permitted and not left.warning and left.faults == ()


def test_a_silent_camera_leads_to_a_handover():
    ecu, bus, step = settled()
    now = 900
    while step.mode == "Active" and now < 3000:
        blind = dict(e_y_m=None, e_theta_rad=None, driver_torque_nm=0.0, wheel_angle_rad=0.0)
        for frame in bus.frames(1000 * now, **blind, motor_torque_nm=step.torque_nm, speed_m_per_s=16.7):
            ecu.receive(*frame, 1000 * now)
        step = ecu.step(1000 * now)
        now += 1
    # Stale at 30 ms, counted from the last picture, and a second without one.
    assert step.mode == "Handover" and step.warning and 1920 <= now <= 1932
    assert step.faults == ("LaneTimeout",)
    assert [frame.id for frame in step.frames][:2] == [0x0C0, 0x0D0]


def test_a_flipped_bit_is_refused_by_its_reason():
    ecu, bus, _ = settled()
    id, data = bus.lane_preview(0.0, 0.0)
    flipped = bytes([*data[:7], data[7] ^ 1])
    assert ecu.receive(id, flipped, 900_000) == "Crc"
    assert ecu.receive(id, data, 900_000) is None
    assert ecu.receive(id, data, 900_000) == "Repeated"
    assert ecu.receive(id, data[:7], 900_000) == "Length"
    assert ecu.receive(0x7FF, b"", 900_000) is None, "none of its inputs"


def test_a_clone_is_independent():
    ecu, bus, _ = settled()
    other = ecu.clone()
    assert ecu.receive(*bus.lane_preview(0.05, 0.0), 900_000) is None
    torques = [[each.step(1000 * (900 + k)).torque_nm for k in range(10)] for each in (ecu, other)]
    assert torques[0][-1] > 0 and torques[1] == [0.0] * 10


def test_a_picture_is_used_until_it_is_150_ms_old():
    def guides(age_us):
        ecu, bus, torque_nm = hg.Ecu(), hg.Bus(), 0.0
        for k in range(1000):
            now = 1000 * k
            values = dict(driver_torque_nm=0.0, wheel_angle_rad=0.0, motor_torque_nm=torque_nm, speed_m_per_s=16.7)
            for frame in bus.frames(now, e_y_m=None, e_theta_rad=None, engage=k >= 600, **values):
                ecu.receive(*frame, now)
            if k % 10 == 0:
                ecu.receive(*bus.lane_preview(0.0, 0.0, age_us=age_us), now)
            step = ecu.step(now)
            torque_nm = step.torque_nm
        return step.mode == "Active"

    assert guides(0) and guides(100_000) and guides(150_000) and not guides(151_000)


def test_a_step_can_be_pickled_and_copied():
    _, _, step = settled(e_y_m=0.2)
    assert step.torque_nm > 0.05 and step != settled()[2]
    ecu, bus, _ = settled()
    blind = max((ecu.step(1000 * k) for k in range(900, 1000)), key=lambda step: (len(step.faults), len(step.frames)))
    assert blind.faults and blind.warning and len(blind.frames) > 1
    for each in (step, blind):
        for again in (pickle.loads(pickle.dumps(each)), copy.copy(each), copy.deepcopy(each)):
            assert again == each and repr(again) == repr(each)
            for name in ("torque_nm", "mode", "limit", "faults", "warning", "permitted", "frames"):
                assert getattr(again, name) == getattr(each, name), name


@pytest.mark.parametrize("params", [None, {"k_1": 0.2, "torque_limit_nm": 2.0}, hg.Scenario(guidance={"k_1_nm": 0.2})])
def test_a_pickled_ecu_goes_on_as_the_original(params):
    """Beyond the wrap of its clock, with a step that came late and frames that it refused."""
    start, inputs = 2**32 - 1_000_000, dict(driver_torque_nm=0.1, wheel_angle_rad=0.01, speed_m_per_s=16.7)
    ecu, bus = hg.Ecu(params, t_us=start), hg.Bus()
    torque_nm, step = 0.0, None

    def drive(ecu, bus, steps, torque_nm):
        taken = []
        for k in steps:
            now = start + 1000 * k + (300 if k == 1500 else 0)
            for frame in bus.frames(now, e_y_m=0.1, e_theta_rad=0.0, motor_torque_nm=torque_nm, engage=k >= 600, probe=True, **inputs):
                ecu.receive(*frame, now)
            if k % 100 == 0:
                assert ecu.receive(0x100, bytes(8), now) == "Crc" and ecu.receive(0x100, b"", now) == "Length"
            taken.append(ecu.step(now))
            torque_nm = taken[-1].torque_nm
        return taken

    step = drive(ecu, bus, range(2000), torque_nm)[-1]
    assert step.mode == "Active"
    again = pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(ecu))))
    # The senders count on where they are.
    buses = [copy.deepcopy(bus), bus]
    expected, got = (drive(each, of, range(2000, 3000), step.torque_nm) for each, of in zip((ecu, again), buses))
    assert got == expected and any(step.torque_nm for step in got)


def test_parameters_are_checked_by_name_and_range():
    listed = {parameter["name"]: parameter for parameter in hg.parameters()}
    assert listed["torque_limit_nm"]["max"] == 5.0 and listed["k_1"]["unit"] == "N.m"
    hg.Ecu({name: parameter["default"] for name, parameter in listed.items()})
    with pytest.raises(hg.RangeError) as caught:
        hg.Ecu({"torque_limit_nm": 6.0})
    assert (caught.value.field, caught.value.value, caught.value.max) == ("torque_limit_nm", 6.0, 5.0)
    with pytest.raises(hg.RangeError):
        hg.Ecu({"k_1": float("nan")})
    with pytest.raises(hg.InputError, match="k_9: no parameter"):
        hg.Ecu({"k_9": 1.0})


def test_frames_that_no_bus_carries_are_refused():
    for id, data in [(0x800, b""), (-1, b""), (0x100, bytes(9))]:
        with pytest.raises(hg.RangeError):
            hg.Ecu().receive(id, data, 0)
        with pytest.raises(hg.RangeError):
            hg.Frame(id, data)
    frame = hg.Frame(0x123, b"\x01\x02")
    assert tuple(frame) == (0x123, b"\x01\x02") and repr(frame) == "Frame(0x123, bytes.fromhex('0102'))"
    assert frame == hg.Frame(0x123, b"\x01\x02") and len({frame, hg.Frame(0x123, b"\x01\x02")}) == 1


def test_values_that_no_sensor_gives_are_refused_and_send_nothing():
    bus, same = hg.Bus(), hg.Bus()
    for refused in (
        lambda: bus.lane_preview(float("nan"), 0.0),
        lambda: bus.column(0.0, float("inf"), 0.0),
        lambda: bus.request(True, authority=1.2),
        lambda: bus.lane_preview(0.0, 0.0, age_us=205_000),
        lambda: bus.lane_preview(0.0, 0.0, age_us=-1),
        lambda: bus.frames(-1, e_y_m=0, e_theta_rad=0, driver_torque_nm=0, wheel_angle_rad=0, motor_torque_nm=0, speed_m_per_s=9),
        lambda: hg.Ecu().step(-1),
        lambda: hg.Ecu().receive(0x100, bytes(8), -1),
        lambda: hg.Ecu(t_us=-1),
    ):
        with pytest.raises(hg.RangeError):
            refused()
    assert bus.lane_preview(0.1, 0.0) == same.lane_preview(0.1, 0.0), "the counter did not move"


def test_the_dbc_reads_what_the_bus_sends():
    cantools = pytest.importorskip("cantools")
    from pathlib import Path

    database = cantools.database.load_file(Path(__file__).parents[3] / "core" / "haptic.dbc")
    bus = hg.Bus()
    for frame, values in [
        (bus.column(1.5, 0.5, -0.25), (1.5, 0.5, -0.25)),
        (bus.vehicle(16.5, 16.25), (16.5, 16.25)),
        (bus.vehicle(16.5, yaw_rate_rad_per_s=-0.25), (16.5, -0.25, 1)),
        (bus.lane_preview(0.5, -0.125), (0.5, -0.125)),
    ]:
        decoded = database.decode_message(frame.id, frame.data, decode_choices=False)
        for value in values:
            # The wheel angle goes over the bus in degrees.
            found = [x for x in decoded.values() if abs(x - value) < 1e-3 or abs(x * 0.017453292519943295 - value) < 1e-3]
            assert found, (decoded, value)
