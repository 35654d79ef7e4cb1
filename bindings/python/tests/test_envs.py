"""Environments: Gymnasium's own check, the closed loop behind them, and many side by side."""

import threading
import time
import warnings

import numpy as np
import pytest

import haptic_guidance as hg

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.utils.env_match import check_environments_match  # noqa: E402

from haptic_guidance import envs  # noqa: E402

SHORT = {"segment": [{"length_m": 150.0}, {"length_m": 100.0, "curvature_per_m": 0.002}]}
NAMES = ("haptic_guidance/Driver-v0", "haptic_guidance/Authority-v0")


def short(**fields):
    return hg.Scenario(course=SHORT, condition="mid", **fields)


@pytest.mark.parametrize("name", NAMES)
def test_gymnasium_finds_nothing_wrong(name):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        env = gymnasium.make(name, scenario=short(driver={"remnant_sd_nm": 0.05}))
        check_env(env.unwrapped)
        check_environments_match(env, gymnasium.make(name, scenario=short(driver={"remnant_sd_nm": 0.05})), 100, seed=3)
    # A torque stays one in N.m, whatever range a trainer would like best.
    others = [str(warning.message) for warning in caught if "symmetric and normalized" not in str(warning.message)]
    assert others == []


def test_the_drivers_torque_is_the_only_one_beside_the_guidances():
    env = envs.DriverEnv(short(), period_ms=20)
    observation, info = env.reset(seed=1)
    slack = short().replace(driver={"a_1_rad_per_m": 0, "a_2_rad_per_m_s": 0, "a_3": 0, "k_d_nm_per_rad": 0, "k_hg": 0, "k_nms_nm_per_rad": 0})
    simulation = hg.Simulation(slack)
    names = list(envs.OBSERVATION)
    assert info["time_s"] == 0.0 and observation[names.index("speed_m_per_s")] == pytest.approx(60 / 3.6)
    for k in range(200):
        hand_nm = float(np.float32(0.5 * np.sin(0.02 * k)))
        samples = []
        for _ in range(20):
            outcome = simulation.step(hg.Action(hand_torque_nm=hand_nm))
            samples += [outcome.sample] if outcome.sample else []
        observation, reward, terminated, truncated, info = env.step(np.array([hand_nm], dtype=np.float32))
        # What is observed is the instant behind the action: the next step of the same.
        ahead = simulation.clone().step(hg.Action(hand_torque_nm=hand_nm)).sample
        for name, value in zip(names, observation):
            if name != "speed_m_per_s":
                assert value == np.float32(ahead[name]), (k, name)
        error = np.mean([s["lateral_error_m"] ** 2 for s in samples])
        effort = np.mean([s["driver_torque_nm"] ** 2 for s in samples])
        conflict = np.mean([max(0.0, -s["driver_torque_nm"] * s["guidance_torque_nm"]) for s in samples])
        assert reward == pytest.approx(-0.02 * (error + 0.1 * effort + conflict), rel=1e-9, abs=1e-15)
        assert info["effort"] == pytest.approx(hand_nm**2, rel=1e-6, abs=1e-12)
        assert not terminated and not truncated


def test_a_hand_that_looks_ahead_keeps_the_lane_and_none_does_not():
    def drive(hand):
        env = envs.DriverEnv(hg.Scenario(condition="manual", course=SHORT), period_ms=10)
        observation, _ = env.reset(seed=1)
        while True:
            o = dict(zip(envs.OBSERVATION, observation))
            observation, reward, terminated, truncated, info = env.step(np.array([hand(o)], dtype=np.float32))
            if terminated or truncated:
                return terminated, reward, info

    def steered(o):
        target = 0.1 * o["e_y_m"] + 3.7 * o["e_theta_rad"]
        return 5 * target - o["wheel_angle_rad"]

    terminated, _, info = drive(steered)
    assert not terminated and abs(info["lateral_error_m"]) < 2.0
    terminated, reward, info = drive(lambda o: 3.0)
    assert terminated and reward < -1000 and info["s_m"] < 250


def test_authority_is_the_share_of_the_guidance():
    bend = hg.Scenario(condition="high", course={"segment": [{"length_m": 300.0, "curvature_per_m": 0.002}]})

    def torque(authority):
        env = envs.AuthorityEnv(bend)
        env.reset(seed=2)
        observation = env.step(np.array([authority], dtype=np.float32))[0]
        return dict(zip(envs.OBSERVATION, observation))["guidance_torque_nm"]

    # After 0.1 s, before the vehicle has moved much.
    assert torque(0.0) == 0.0 < torque(1.0)
    assert torque(0.5) == pytest.approx(0.5 * torque(1.0), rel=0.2)


@pytest.mark.parametrize("name", NAMES)
def test_many_side_by_side_are_as_many_single_ones(name):
    make = lambda mode: gymnasium.make_vec(
        name, num_envs=5, vectorization_mode=mode, scenario=short(driver={"remnant_sd_nm": 0.05}), period_ms=500
    )
    ours, theirs = make("vector_entry_point"), make("sync")
    assert ours.single_action_space == theirs.single_action_space and ours.action_space == theirs.action_space
    assert ours.observation_space == theirs.observation_space and ours.num_envs == 5
    ours.action_space.seed(4)
    episodes = 0
    results = [vector.reset(seed=11) for vector in (ours, theirs)]
    for _ in range(120):
        (observation, info), (expected, expected_info) = results
        assert observation.dtype == np.float32 and np.array_equal(observation, expected)
        assert observation in ours.observation_space
        assert set(info) == set(expected_info)
        for key in info:
            assert np.array_equal(info[key], expected_info[key]), key
        actions = ours.action_space.sample()
        stepped = [vector.step(actions) for vector in (ours, theirs)]
        for a, b in zip(stepped[0][1:4], stepped[1][1:4]):
            assert np.array_equal(a, b) and a.dtype == b.dtype
        episodes += int((stepped[0][2] | stepped[0][3]).sum())
        results = [(one[0], one[4]) for one in stepped]
    assert episodes >= 5, "some begun anew"


def test_a_seed_gives_the_same_drives_again():
    def drives(seed):
        vector = envs.AuthorityVectorEnv(3, short(driver={"remnant_sd_nm": 0.1}))
        vector.reset(seed=seed)
        return np.stack([vector.step(np.full((3, 1), 0.5, dtype=np.float32))[0] for _ in range(60)])

    assert np.array_equal(drives(5), drives(5)) and not np.array_equal(drives(5), drives(6))
    assert np.array_equal(drives(5)[:, 1], drives(6)[:, 0]), "loop i has seed + i"


@pytest.mark.parametrize("name", NAMES)
def test_another_seed_is_another_drive_unless_told_otherwise(name):
    def drive(seed):
        env = gymnasium.make(name)
        first = env.reset(seed=seed)[0]
        assert env.reset(seed=seed)[0][-1] == first[-1]
        action = np.zeros(1, dtype=np.float32)
        seen = [first] + [env.step(action)[0] for _ in range(30)]
        # The next drive is drawn too.
        return np.stack(seen), np.stack([env.reset()[0]] + [env.step(action)[0] for _ in range(30)])

    drives = [each for seed in (1, 2, 1) for each in drive(seed)]
    assert np.array_equal(drives[0], drives[4]) and np.array_equal(drives[1], drives[5])
    for i in range(4):
        for other in drives[:i]:
            assert not np.array_equal(drives[i], other)


def test_the_drivers_speed_is_drawn_from_50_to_80():
    env = envs.DriverEnv()
    speeds = [float(env.reset(seed=seed)[0][-1]) * 3.6 for seed in range(20)]
    assert len(set(speeds)) == 20 and 50 <= min(speeds) < 60 and 70 < max(speeds) <= 80


def test_a_function_makes_a_scenario_for_each_drive():
    env = envs.AuthorityEnv(lambda rng: short(speed_m_per_s=float(rng.uniform(11, 25))))
    speeds = {float(env.reset(seed=seed)[0][-1]) for seed in (1, 2, 1, 3)}
    assert len(speeds) == 3
    assert env.reset(options={"scenario": short(speed_m_per_s=100 / 3.6)})[0][-1] == pytest.approx(100 / 3.6)


def test_a_step_of_many_releases_the_interpreter():
    vector = envs.AuthorityVectorEnv(64, hg.Scenario(course={"segment": [{"length_m": 100_000.0}]}), period_ms=10_000)
    vector.reset(seed=1)
    turns, stop = [], threading.Event()

    def count():
        while not stop.is_set():
            turns.append(None)
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    while not turns:
        time.sleep(0.001)
    before = len(turns)
    # One call: eleven minutes of driving.
    vector.step(np.ones((64, 1), dtype=np.float32))
    during = len(turns) - before
    stop.set()
    thread.join()
    assert during >= 3


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: envs.DriverEnv("high"), hg.InputError, "scenario: a str is no Scenario"),
        (lambda: envs.DriverEnv(most_torque_nm=100), hg.RangeError, "most_torque_nm = 100 N.m is outside 0.1 to 50"),
        (lambda: envs.DriverEnv(period_ms=7), hg.InputError, "period_ms = 7 ms is no multiple of 5 ms"),
        (lambda: envs.AuthorityEnv(period_ms=0), hg.RangeError, "period_ms = 0 ms is outside 5 to 10000"),
        (lambda: envs.AuthorityEnv(reward={"comfort": 1.0}), hg.InputError, "reward: comfort is none of error, effort"),
        (lambda: envs.AuthorityEnv(reward={"error": -1.0}), hg.RangeError, "reward.error = -1 is outside 0"),
        (lambda: envs.AuthorityVectorEnv(0), hg.RangeError, "num_envs = 0 is outside 1 to 65536"),
        (lambda: envs.AuthorityEnv().step(np.array([0.5])), hg.InputError, "not begun: reset"),
        (lambda: envs.AuthorityVectorEnv(2).step(np.ones((2, 1))), hg.InputError, "not begun: reset"),
        (lambda: envs.AuthorityVectorEnv(2).reset(seed=[1]), hg.InputError, "seed: 1 values where num_envs = 2"),
        (lambda: envs.AuthorityEnv().reset(options={"speed": 3}), hg.InputError, "options: speed is none of scenario"),
        (lambda: envs.AuthorityEnv(lambda rng: None).reset(), hg.InputError, "scenario: a NoneType is no Scenario"),
    ],
)
def test_what_makes_no_environment_is_refused_by_name(make, error, says):
    with pytest.raises(error, match=says):
        make()


def test_an_action_that_cannot_be_leaves_the_drive_as_it_was():
    env, same = (envs.DriverEnv(short()) for _ in range(2))
    vector, alike = (envs.DriverVectorEnv(2, short()) for _ in range(2))
    for one in (env, same, vector, alike):
        one.reset(seed=1)
    for action, error, says in [
        ([np.nan], hg.RangeError, "hand_torque_nm = nan N.m is outside -10 to 10 N.m"),
        ([11.0], hg.RangeError, "hand_torque_nm = 11 N.m is outside -10 to 10 N.m"),
        ([1.0, 2.0], hg.InputError, "shape"),
    ]:
        with pytest.raises(error, match=says):
            env.step(np.array(action))
        with pytest.raises(error, match=says):
            vector.step(np.array([[0.0] * len(action), action]))
    for one, other, action in ((env, same, np.array([0.5])), (vector, alike, np.full((2, 1), 0.5))):
        got, expected = one.step(action), other.step(action)
        assert np.array_equal(got[0], expected[0]) and np.array_equal(got[1], expected[1])


def test_a_drive_that_has_ended_takes_no_action():
    env = envs.AuthorityEnv(short(), period_ms=10_000)
    env.reset(seed=1)
    truncated = False
    while not truncated:
        _, _, terminated, truncated, _ = env.step(np.array([1.0]))
        assert not terminated
    with pytest.raises(hg.InputError, match="the drive has ended: reset"):
        env.step(np.array([1.0]))
