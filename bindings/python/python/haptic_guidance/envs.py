"""Environments for Gymnasium (needs the extra ``gym``): a driver to be trained, and a guidance to be dosed.

Importing this module registers ``haptic_guidance/Driver-v0`` and ``haptic_guidance/Authority-v0``. `gymnasium.make` gives
one closed loop, `gymnasium.make_vec` many that are moved in one call on every core.

Examples
--------
>>> import gymnasium, haptic_guidance.envs
>>> env = gymnasium.make("haptic_guidance/Authority-v0")
>>> observation, info = env.reset(seed=1)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Optional, Union

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ._errors import InputError, check_range
from ._native import Scenario, Simulations

__all__ = ["AuthorityEnv", "AuthorityVectorEnv", "DriverEnv", "DriverVectorEnv", "OBSERVATION", "REWARD"]

#: What is observed, in order: name with unit, and the largest magnitude; beyond it the observation is cut.
OBSERVATION: dict[str, float] = {
    "e_y_m": 50.0,
    "e_theta_rad": 3.2,
    "lateral_error_m": 20.0,
    "heading_error_rad": 3.2,
    "wheel_angle_rad": 20.0,
    "wheel_rate_rad_per_s": 100.0,
    "yaw_rate_rad_per_s": 10.0,
    "driver_torque_nm": 100.0,
    "guidance_torque_nm": 10.0,
    "speed_m_per_s": 70.0,
}

#: Weights of the reward, taken off for each second: the square of the lateral error (1/m^2), the square of the driver torque
#: (1/(N.m)^2), and the product of driver and guidance torque while the two oppose each other (1/(N.m)^2). ``off_road`` is
#: taken off once, when the vehicle leaves the road.
REWARD: dict[str, float] = {"error": 1.0, "effort": 0.1, "conflict": 1.0, "off_road": 1000.0}

Drives = Union[Scenario, Callable[[np.random.Generator], Scenario], None]

_HIGH = np.array(list(OBSERVATION.values()), dtype=np.float32)
_TOLD = ("time_s", "s_m", "lateral_error_m", "unguided_cause")
_TERMS = ("error", "effort", "conflict")
# The arm of nobody: the torque on the wheel is the agent's.
_SLACK = dict.fromkeys(
    ("a_1_rad_per_m", "a_2_rad_per_m_s", "a_3", "k_d_nm_per_rad", "k_hg", "k_nms_nm_per_rad"), 0.0
)


class _Loops:
    """Closed loops with their scenarios, rewards and random numbers; the agent's part is what the environments add."""

    period_ms = 10
    low, high = 0.0, 1.0
    field, unit = "", ""

    def __init__(
        self,
        count: int,
        scenario: Drives,
        period_ms: Optional[int],
        reward: Optional[Mapping[str, float]],
        most: Optional[float] = None,
    ) -> None:
        self.count = count
        # What is cut is cut to what the space holds.
        self.loops = Simulations(count, list(zip(OBSERVATION, _HIGH.tolist())), list(_TOLD))
        self.scenario = self.default if scenario is None else scenario
        if not (isinstance(self.scenario, Scenario) or callable(self.scenario)):
            raise InputError(f"scenario: a {type(scenario).__name__} is no Scenario and no function that makes one")
        if period_ms is not None:
            check_range("period_ms", period_ms, 5, 10_000, "ms")
            if period_ms % 5:
                raise InputError(f"period_ms = {period_ms} ms is no multiple of 5 ms")
            self.period_ms = int(period_ms)
        weights = {**REWARD, **(reward or {})}
        if set(weights) != set(REWARD):
            raise InputError(f"reward: {', '.join(set(weights) - set(REWARD))} is none of {', '.join(REWARD)}")
        for name, weight in weights.items():
            check_range(f"reward.{name}", weight, 0.0, 1e9, "")
        self.weights_of_one = [float(weights[name]) for name in _TERMS]
        self.weights = np.array(self.weights_of_one)
        self.off_road = float(weights["off_road"])
        if most is not None:
            check_range("most_torque_nm", most, 0.1, 50.0, "N.m")
            self.low, self.high = -float(most), float(most)
        self.action_space = Box(self.low, self.high, (1,), np.float32)
        self.observation_space = Box(-_HIGH, _HIGH, dtype=np.float32)
        self.slack: Optional[Scenario] = None

    def begin(self, index: int, rng: np.random.Generator, options: Optional[Mapping[str, Any]]):
        """Begins a drive: its scenario, and a seed that the generator draws."""
        scenario = (options or {}).get("scenario", self.scenario)
        if callable(scenario):
            scenario = scenario(rng)
        if not isinstance(scenario, Scenario):
            raise InputError(f"scenario: a {type(scenario).__name__} is no Scenario")
        return self.loops.begin(index, self.prepared(scenario), int(rng.integers(2**63)))

    def prepared(self, scenario: Scenario) -> Scenario:
        return scenario

    def step_one(self, action: Any):
        """Moves the only one; what is seen and told, reward, how it ended, terms of the reward."""
        array = np.asarray(action, dtype=np.float64)
        if array.shape != (1,):
            raise InputError(f"action: shape {array.shape} where (1,) is wanted")
        value = array.item()
        if not self.low <= value <= self.high:
            check_range(self.field, value, self.low, self.high, self.unit)
        hand, authority = (value, 1.0) if self.field == "hand_torque_nm" else (0.0, value)
        seen, told, costs, ending = self.loops.step_one(0, hand, authority, self.period_ms)
        error, effort, conflict = (cost * weight for cost, weight in zip(costs, self.weights_of_one))
        reward = -(error + effort + conflict) * (self.period_ms * 1e-3) - self.off_road * (ending == 2)
        return seen, told, reward, ending, costs

    def step(self, actions: Any, active: np.ndarray):
        """Moves those that are active; what is seen and told, rewards, how they ended, terms of the reward."""
        actions = np.asarray(actions, dtype=np.float64)
        if actions.shape != (self.count, 1):
            raise InputError(f"action: shape {actions.shape} where {(self.count, 1)} is wanted")
        given = actions[active, 0]
        for value in given[~((given >= self.low) & (given <= self.high))][:1]:
            check_range(self.field, value, self.low, self.high, self.unit)
        hands, authorities = np.zeros(self.count), np.ones(self.count)
        (hands if self.field == "hand_torque_nm" else authorities)[active] = actions[active, 0]
        seen, told, costs, endings = self.loops.step(hands, authorities, active, self.period_ms)
        # Added up in the order of `step_one`, so that one and many give the same bits.
        error, effort, conflict = (costs * self.weights).T
        rewards = -(error + effort + conflict) * (self.period_ms * 1e-3) - self.off_road * (endings == 2)
        return seen, told, rewards, endings, costs


class _Driver(_Loops):
    @staticmethod
    def default(rng: np.random.Generator) -> Scenario:
        return Scenario(condition="mid", speed_m_per_s=rng.uniform(50.0, 80.0) / 3.6)

    field, unit = "hand_torque_nm", "N.m"

    def prepared(self, scenario: Scenario) -> Scenario:
        # The usual case is one scenario for all drives: it is read once.
        if scenario is not self.scenario:
            return scenario.replace(driver=_slack(scenario))
        if self.slack is None:
            self.slack = scenario.replace(driver=_slack(scenario))
        return self.slack


def _slack(scenario: Scenario) -> Any:
    return {name: value for name, value in _SLACK.items() if name != "K_hg" or scenario.condition != "manual"}


class _Authority(_Loops):
    default = Scenario(condition="mid", driver={"remnant_sd_nm": 0.072})
    period_ms = 100
    field, unit = "authority", ""


def _check_options(options: Optional[Mapping[str, Any]]) -> None:
    for name in set(options or ()) - {"scenario"}:
        raise InputError(f"options: {name} is none of scenario")


class _Env(gymnasium.Env):
    """One closed loop."""

    metadata = {"render_modes": []}
    _loops: _Loops

    def _set(self, loops: _Loops) -> None:
        self._loops = loops
        self.action_space, self.observation_space = loops.action_space, loops.observation_space
        self._ended: Optional[str] = "not begun"

    def reset(
        self, *, seed: Optional[int] = None, options: Optional[dict[str, Any]] = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin a drive. ``options={"scenario": ...}`` drives another one this once."""
        _check_options(options)
        super().reset(seed=seed)
        seen, told = self._loops.begin(0, self.np_random, options)
        self._ended = None
        return seen, dict(zip(_TOLD, told))

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Drive on under an action for ``period_ms``."""
        if self._ended is not None:
            raise InputError(f"the drive has {self._ended}: reset() begins one")
        seen, told, reward, ending, costs = self._loops.step_one(action)
        self._ended = (None, "ended", "left the road")[ending]
        return seen, reward, ending == 2, ending == 1, dict(zip(_TOLD + _TERMS, told + costs))


class _VectorEnv(VectorEnv):
    """Closed loops side by side; one that has ended begins anew in the next step."""

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}
    _loops: _Loops

    def _set(self, loops: _Loops) -> None:
        self._loops, self.num_envs = loops, loops.count
        self.single_action_space, self.single_observation_space = loops.action_space, loops.observation_space
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._generators: list[Optional[np.random.Generator]] = [None] * self.num_envs
        self._over = np.zeros(self.num_envs, dtype=bool)
        self._begun = False

    def reset(
        self, *, seed: Union[int, Sequence[Optional[int]], None] = None, options: Optional[dict[str, Any]] = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin all drives; loop ``i`` with ``seed + i``, as `gymnasium.make` with that seed begins."""
        _check_options(options)
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, (int, np.integer)) else seed
        seeds = [None] * self.num_envs if seeds is None else list(seeds)
        if len(seeds) != self.num_envs:
            raise InputError(f"seed: {len(seeds)} values where num_envs = {self.num_envs}")
        for i, one in enumerate(seeds):
            if one is not None or self._generators[i] is None:
                self._generators[i] = seeding.np_random(one)[0]
        begun = [self._loops.begin(i, self._generators[i], options) for i in range(self.num_envs)]
        seen, told = (np.stack(each) for each in zip(*begun))
        self._over[:] = False
        self._begun = True
        return seen, self._infos(told, None, ~self._over)

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Drive all on; those that ended in the step before begin anew instead."""
        if not self._begun:
            raise InputError("the drives have not begun: reset() begins them")
        fresh = self._over
        seen, told, rewards, endings, costs = self._loops.step(actions, ~fresh)
        for i in np.flatnonzero(fresh):
            seen[i], told[i] = self._loops.begin(i, self._generators[i], None)
        rewards[fresh] = 0.0
        terminated, truncated = endings == 2, endings == 1
        self._over = terminated | truncated
        return seen, rewards, terminated, truncated, self._infos(told, costs, ~fresh)

    def _infos(self, told: np.ndarray, costs: Optional[np.ndarray], moved: np.ndarray) -> dict[str, np.ndarray]:
        every = np.ones(self.num_envs, dtype=bool)
        infos: dict[str, np.ndarray] = {}
        for name, column in zip(_TOLD, told.T):
            infos[name], infos[f"_{name}"] = column.copy(), every
        if costs is not None and moved.any():
            for name, column in zip(_TERMS, costs.T):
                infos[name], infos[f"_{name}"] = column.copy(), moved
        return infos


_SHARED = """
    scenario : Scenario or callable, optional
        What is driven; a function gets the environment's random generator and makes one for each drive. The seed of
        a scenario is replaced by one that the generator draws.
    period_ms : int, optional
        How long an action lasts, a multiple of 5 ms.
    reward : mapping of str to float, optional
        Weights that replace those of `REWARD`.
"""


class DriverEnv(_Env):
    __doc__ = f"""The driver as agent: its torque on the wheel beside the guidance's.

    The action is one torque, N.m, positive turns left. The observation is `OBSERVATION`. A drive is terminated when the vehicle
    leaves the road, and truncated at the end of the course.

    Parameters
    ----------{_SHARED}    most_torque_nm : float, optional
        The largest torque of an action, N.m, 0.1 to 50.
    """

    def __init__(
        self,
        scenario: Drives = None,
        *,
        period_ms: Optional[int] = None,
        reward: Optional[Mapping[str, float]] = None,
        most_torque_nm: float = 10.0,
    ) -> None:
        self._set(_Driver(1, scenario, period_ms, reward, most_torque_nm))


class AuthorityEnv(_Env):
    __doc__ = f"""The authority of the guidance as action, 0 to 1, while the driver of the scenario drives.

    The observation is `OBSERVATION`. A drive is terminated when the vehicle leaves the road, and truncated at the end of the
    course.

    Parameters
    ----------{_SHARED}    """

    def __init__(
        self,
        scenario: Drives = None,
        *,
        period_ms: Optional[int] = None,
        reward: Optional[Mapping[str, float]] = None,
    ) -> None:
        self._set(_Authority(1, scenario, period_ms, reward))


class DriverVectorEnv(_VectorEnv):
    __doc__ = f"""Many of `DriverEnv`, moved in one call on every core.

    Parameters
    ----------
    num_envs : int
        How many.{_SHARED}    most_torque_nm : float, optional
        As of `DriverEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scenario: Drives = None,
        *,
        period_ms: Optional[int] = None,
        reward: Optional[Mapping[str, float]] = None,
        most_torque_nm: float = 10.0,
    ) -> None:
        self._set(_Driver(num_envs, scenario, period_ms, reward, most_torque_nm))


class AuthorityVectorEnv(_VectorEnv):
    __doc__ = f"""Many of `AuthorityEnv`, moved in one call on every core.

    Parameters
    ----------
    num_envs : int
        How many.{_SHARED}    """

    def __init__(
        self,
        num_envs: int = 1,
        scenario: Drives = None,
        *,
        period_ms: Optional[int] = None,
        reward: Optional[Mapping[str, float]] = None,
    ) -> None:
        self._set(_Authority(num_envs, scenario, period_ms, reward))


for _name in ("Driver", "Authority"):
    gymnasium.register(
        f"haptic_guidance/{_name}-v0",
        entry_point=f"{__name__}:{_name}Env",
        vector_entry_point=f"{__name__}:{_name}VectorEnv",
    )
