"""Scenarios: every way to make one, and what is refused."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

import haptic_guidance as hg

EXAMPLES = Path(__file__).parents[3] / "examples"
COURSE = {"lane_width_m": 3.5, "segment": [{"length_m": 400.0}, {"length_m": 200.0, "curvature_per_m": 0.002}]}


def test_the_file_with_every_field_holds_the_defaults():
    assert hg.Scenario.load(EXAMPLES / "every-field.toml") == hg.Scenario()


def test_keywords_dict_and_toml_say_the_same():
    keywords = hg.Scenario(speed_m_per_s=20, condition="high", driver={"t_p_s": 0.3}, failure={"kind": "torque", "time_s": 20})
    fields = {"speed_m_per_s": 20, "condition": "high", "driver": {"t_p_s": 0.3}, "failure": {"kind": "torque", "time_s": 20}}
    text = 'speed_m_per_s = 20\ncondition = "high"\ndriver.t_p_s = 0.3\nfailure = { kind = "torque", time_s = 20 }'
    assert keywords == hg.Scenario.from_dict(fields) == hg.Scenario.from_toml(text)
    assert keywords != hg.Scenario()
    assert (keywords.speed_kmh, keywords.condition, keywords.k_d, keywords.k_hg) == (72.0, "high", 2.0, 0.0)
    assert (keywords.t_p_s, keywords.failure_time_s) == (0.3, 20.0)


def test_numbers_of_numpy_are_numbers():
    assert hg.Scenario(speed_m_per_s=np.float64(20), seed=np.int64(7)) == hg.Scenario(speed_m_per_s=20.0, seed=7)


def test_a_speed_that_changes_is_a_mapping_or_a_table():
    # 20 m/s for 5 s, 2 m/s2 less for 5 s: 100 and 75 m; the far point, 10 m ahead, ends the rest of 300 m at 290.
    speed = {"time_s": [5, 10], "speed_m_per_s": np.array([20.0, 10.0]).tolist()}
    braking = hg.Scenario(course={"segment": [{"length_m": 300.0}]}, speed=speed)
    assert (braking.speed_kmh, braking.speed_m_per_s) == (72.0, 20.0)
    assert braking.duration_s == pytest.approx(21.5)
    assert pickle.loads(pickle.dumps(braking)) == braking == hg.Scenario.from_toml(braking.to_toml())
    run = hg.simulate(braking)
    assert run["speed_m_per_s"][[0, 1500, -1]] == pytest.approx([20.0, 15.0, 10.0])
    assert run.metrics["min_speed_m_per_s"] == pytest.approx(10.0)
    assert braking == braking.replace(speed={"time_s": (5, 10), "speed_m_per_s": (20.0, 10.0)}), "a tuple is as good as a list"
    by_place = braking.replace(speed={"place_m": [50, 200], "speed_m_per_s": [20.0, 10.0]})
    assert by_place.to_dict()["speed"] == {"place_m": [50, 200], "speed_m_per_s": [20.0, 10.0]}
    assert by_place.replace(speed_m_per_s=60 / 3.6) == hg.Scenario(course={"segment": [{"length_m": 300.0}]})
    with pytest.raises(hg.RangeError, match="acceleration to point 2 = -11.111 m/s2"):
        hg.Scenario(speed={"time_s": [0, 1], "speed_m_per_s": [27.77777777777778, 16.666666666666668]})
    with pytest.raises(hg.InputError, match="point 2"):
        hg.Scenario(speed={"time_s": [4, 3], "speed_m_per_s": [16.666666666666668, 16.666666666666668]})


def test_a_course_comes_from_a_file_or_as_its_content():
    scenario = hg.Scenario(course=COURSE)
    assert (scenario.course_length_m, scenario.lane_width_m) == (600.0, 3.5)
    hill = hg.Scenario.load(EXAMPLES / "relying-driver.toml")
    assert hill.course_name.endswith("hill-road.toml")
    same = hg.Scenario(course=EXAMPLES / "hill-road.toml")
    assert same.course_length_m == hill.course_length_m


@pytest.mark.parametrize("scenario", [hg.Scenario(course=COURSE, seed=3), hg.Scenario.load(EXAMPLES / "relying-driver.toml")])
def test_a_pickle_is_the_same_scenario(scenario):
    again = pickle.loads(pickle.dumps(scenario))
    assert again == scenario and again.course_length_m == scenario.course_length_m
    assert copy.deepcopy(scenario) == scenario


def test_the_text_of_a_scenario_is_the_scenario():
    scenario = hg.Scenario(course=COURSE, condition="low", driver={"t_p_s": 0.1234567890123456}, seed=3)
    assert hg.Scenario.from_toml(scenario.to_toml()) == scenario


def test_replace_changes_one_field_of_a_table():
    scenario = hg.Scenario(driver={"t_p_s": 0.3, "a_1_rad_per_m": 0.2}, course=COURSE)
    changed = scenario.replace(driver={"t_p_s": 0.5})
    assert changed == hg.Scenario(driver={"t_p_s": 0.5, "a_1_rad_per_m": 0.2}, course=COURSE)
    assert scenario.t_p_s == 0.3
    assert scenario.replace(course="paper-course").course_length_m == 3350.0


@pytest.mark.parametrize(
    ("fields", "field", "value", "low", "high", "unit"),
    [
        ({"speed_m_per_s": 80}, "speed_m_per_s", 80.0, 5.5, 70.0, "m/s"),
        ({"driver": {"t_p_s": 5}}, "driver.t_p_s", 5.0, 0.001, 2.0, "s"),
        ({"guidance": {"torque_limit_nm": 9.0}}, "guidance.torque_limit_nm", 9.0, 0.1, 5.0, "N.m"),
        ({"failure": {"kind": "torque", "time_s": -1}}, "failure.time_s", -1.0, 0.0, 1e6, "s"),
    ],
)
def test_a_value_out_of_range_is_named_with_its_range(fields, field, value, low, high, unit):
    with pytest.raises(hg.RangeError) as caught:
        hg.Scenario(**fields)
    error = pickle.loads(pickle.dumps(caught.value))
    assert (error.field, error.value, error.min, error.max, error.unit) == (field, value, low, high, unit)
    assert field in str(error) and isinstance(error, ValueError)


def test_nan_is_out_of_range():
    with pytest.raises(hg.RangeError, match="speed_m_per_s = NaN"):
        hg.Scenario(speed_m_per_s=float("nan"))


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"sped": 60}, "^Scenario: there is no 'sped'; did you mean 'speed'\\? There are course, road, "),
        ({"driver": {"t_pp": 0.3}}, "^driver: there is no 't_pp'; did you mean 't_p_s'\\? There are .*t_p_s, t_n_s"),
        ({"speed_m_per_s": 20, "driver": {"t_p_s": 0.3, "xyz": 1}}, "^driver: there is no 'xyz'. There are .*t_p_s, t_n_s"),
        ({"speed_m_per_s": "fast"}, "^speed_m_per_s: .*expected a number"),
        ({"driver": {"t_p_s": "slow"}}, "^driver.t_p_s: .*expected a number"),
        ({"seed": -1}, "^seed: .*expected a whole number, 0 or more"),
        ({"course": {"segment": [{"lenght": 100}]}}, "^course: "),
        ({"driver_change": {"time_s": 3}}, "^driver_change: missing field `k_d_nm_per_rad`"),
        ({"condition": "hihg"}, "^condition: there is no 'hihg'; did you mean 'high'\\? There are manual, high, "),
        ({"driver": {"t_p_s": object()}}, "driver.t_p_s: a object is no number"),
        ({"course": "no-such.toml"}, "no-such.toml"),
        ({"condition": "manual", "failure": {"kind": "torque"}}, "manual"),
        ({"course": {"segment": [{"length_m": 100, "curvature_per_m": 1.0}]}}, "segment 1: curvature_per_m = 1"),
    ],
)
def test_what_makes_no_scenario_is_refused_by_name(fields, says):
    with pytest.raises(hg.InputError, match=says):
        hg.Scenario(**fields)


def test_a_wrong_keyword_is_a_key_error_and_bad_input_at_once():
    for error in (KeyError, ValueError, hg.InputError):
        with pytest.raises(error) as caught:
            hg.Scenario().replace(sped=60)
        assert "TOML" not in str(caught.value) and str(caught.value).startswith("Scenario: ")
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_everything_public_is_documented():
    for name in hg.__all__:
        thing = getattr(hg, name)
        assert thing.__doc__, name
        for member in vars(thing) if isinstance(thing, type) else ():
            if not member.startswith("_") and callable(getattr(thing, member)):
                assert getattr(thing, member).__doc__, f"{name}.{member}"


def test_a_course_may_leave_out_what_a_course_file_may():
    short = {"segment": [{"length_m": 300.0}, {"length_m": 100.0, "curvature_per_m": 0.001}]}
    long = {"name": "course", "lane_width_m": 3.6, "segment": [
        {"length_m": 300.0, "curvature_start_per_m": 0.0, "curvature_end_per_m": 0.0},
        {"length_m": 100.0, "curvature_start_per_m": 0.001, "curvature_end_per_m": 0.001},
    ]}  # fmt: skip
    assert hg.Scenario(course=short) == hg.Scenario(course=long)
