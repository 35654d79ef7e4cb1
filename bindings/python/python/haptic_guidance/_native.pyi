from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, Optional, Union, final

import numpy as np
from typing_extensions import Required, TypedDict, Unpack

# A test holds the fields of a scenario to those that the simulator knows.

class SpeedTable(TypedDict, total=False):
    time: Sequence[float]
    place: Sequence[float]
    kmh: Required[Sequence[float]]

class SegmentTable(TypedDict, total=False):
    length: Required[float]
    curvature: float
    curvature_start: float
    curvature_end: float
    bank: float
    bank_start: float
    bank_end: float
    grade: float
    grade_start: float
    grade_end: float

class CourseTable(TypedDict, total=False):
    name: str
    lane_width: float
    segment: Sequence[SegmentTable]
    opendrive: str

class DriverTable(TypedDict, total=False):
    a_1: float
    a_2: float
    a_3: float
    t_p: float
    t_n: float
    t_f: float
    t_nms: float
    K_nms: float
    K_d: float
    K_hg: float
    manual_K_d: float
    remnant_sd: float
    remnant_corner: float
    answers_hands_off_after: float
    line: float

class VehicleTable(TypedDict, total=False):
    m: float
    I: float
    l_f: float
    l_r: float
    K_f: float
    K_r: float
    K_s: float
    E_t: float
    B_s: float
    J_s: float
    K_t: float

class GuidanceTable(TypedDict, total=False):
    K_1: float
    a_1: float
    a_2: float
    a_3: float
    a_4: float
    t_n: float
    t_f: float
    rate_corner_hz: float
    torque_limit_nm: float
    wind_up_nm_per_s: float
    reduction_nm_per_s: float
    low_speed_share: float
    high_speed_share: float
    least_speed_m_per_s: float
    probe: bool
    probe_amplitude_nm: float
    probe_frequency_hz: float

class FailureTable(TypedDict, total=False):
    kind: Literal["none", "torque", "input"]
    time: float
    duration: float

class DriverChangeTable(TypedDict):
    time: float
    K_d: float
    K_hg: float

class WorldTable(TypedDict, total=False):
    tyres: Literal["linear", "saturating"]
    mu: float
    castor_share: float
    bank: float
    friction: float
    friction_give: float
    assist: float
    assist_speed: float
    motor_lag: float
    motor_error: float
    motor_ripple: float
    wind: float
    gust_sd: float
    gust_corner: float
    wind_lever: float

class SensorErrorsTable(TypedDict, total=False):
    torque_bias: float
    torque_gain: float
    angle_bias: float
    speed_gain: float
    yaw_rate_bias: float
    yaw_rate_gain: float
    yaw_rate_noise: float
    lane_noise: float
    heading_noise: float
    camera_yaw: float
    camera_latency: float
    camera_jitter: float
    dropouts: float
    dropout: float
    line_jumps: float
    line_jump: float

class TolerancesTable(TypedDict, total=False):
    car: int
    tyres: float
    trail: float
    load: float
    friction_least: float
    friction_most: float
    motor_error: float
    motor_lag: float
    torque_bias: float
    torque_gain: float
    angle_bias: float
    speed_gain: float
    camera_yaw: float
    yaw_rate_bias: float

class ScenarioFields(TypedDict, total=False):
    course: Union[str, PathLike[str], CourseTable]
    road: str
    lane: int
    turn: list[str]
    speed: Union[float, SpeedTable]
    condition: Literal["manual", "high", "mid", "low"]
    sensors: Literal["exact", "paper"]
    seed: int
    driver: DriverTable
    vehicle: VehicleTable
    guidance: GuidanceTable
    failure: FailureTable
    driver_change: Optional[DriverChangeTable]
    world: WorldTable
    sensor_errors: SensorErrorsTable
    tolerances: TolerancesTable

@final
class Scenario:
    def __init__(self, **fields: Unpack[ScenarioFields]) -> None: ...
    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> Scenario: ...
    @staticmethod
    def from_toml(text: str) -> Scenario: ...
    @staticmethod
    def load(path: Union[str, PathLike[str]]) -> Scenario: ...
    def replace(self, **fields: Unpack[ScenarioFields]) -> Scenario: ...
    def to_dict(self) -> dict[str, Any]: ...
    def to_toml(self) -> str: ...
    @property
    def speed_kmh(self) -> float: ...
    @property
    def speed_m_per_s(self) -> float: ...
    @property
    def condition(self) -> str: ...
    @property
    def k_d(self) -> float: ...
    @property
    def k_hg(self) -> float: ...
    @property
    def t_p_s(self) -> float: ...
    @property
    def failure_time_s(self) -> Optional[float]: ...
    @property
    def course_name(self) -> str: ...
    @property
    def course_length_m(self) -> float: ...
    @property
    def lane_width_m(self) -> float: ...
    @property
    def duration_s(self) -> float: ...
    @property
    def seed(self) -> int: ...

@final
class Action:
    def __init__(
        self,
        engage: Optional[bool] = None,
        authority: Optional[float] = None,
        probe: Optional[bool] = None,
        hand_torque_nm: float = 0.0,
        torque_lost: bool = False,
        lane_lost: bool = False,
    ) -> None: ...

@final
class Frame:
    def __init__(self, id: int, data: Union[bytes, bytearray]) -> None: ...
    @property
    def id(self) -> int: ...
    @property
    def data(self) -> bytes: ...
    def __iter__(self) -> Iterator[Any]: ...
    def __hash__(self) -> int: ...

@final
class Outcome:
    @property
    def time_s(self) -> float: ...
    @property
    def e_y_m(self) -> float: ...
    @property
    def e_theta_rad(self) -> float: ...
    @property
    def driver_torque_nm(self) -> float: ...
    @property
    def wheel_angle_rad(self) -> float: ...
    @property
    def decided_torque_nm(self) -> float: ...
    @property
    def guidance_torque_nm(self) -> float: ...
    @property
    def guidance_limited(self) -> bool: ...
    @property
    def mode(self) -> Optional[str]: ...
    @property
    def faults(self) -> tuple[str, ...]: ...
    @property
    def warning(self) -> bool: ...
    @property
    def k_hg(self) -> Optional[tuple[float, float]]: ...
    @property
    def unguided(self) -> Optional[str]: ...
    @property
    def sample(self) -> Optional[dict[str, float]]: ...
    @property
    def frames_in(self) -> list[Frame]: ...
    @property
    def frames_out(self) -> list[Frame]: ...

@final
class DriverView:
    @property
    def step(self) -> int: ...
    @property
    def time_s(self) -> float: ...
    @property
    def e_y_m(self) -> float: ...
    @property
    def e_theta_rad(self) -> float: ...
    @property
    def near_m(self) -> float: ...
    @property
    def far_m(self) -> float: ...
    @property
    def wheel_angle_rad(self) -> float: ...
    @property
    def wheel_rate_rad_per_s(self) -> float: ...
    @property
    def speed_m_per_s(self) -> float: ...
    @property
    def yaw_rate_rad_per_s(self) -> float: ...
    @property
    def guidance_torque_nm(self) -> float: ...
    @property
    def warning(self) -> bool: ...
    @property
    def asks_for_hands(self) -> bool: ...

@final
class Simulation:
    def __init__(self, scenario: Scenario, own_driver: bool = False) -> None: ...
    def view(self) -> Optional[DriverView]: ...
    def step(self, action: Optional[Action] = None, steps: int = 1) -> Optional[Outcome]: ...
    def clone(self) -> Simulation: ...
    @property
    def steps(self) -> int: ...
    @property
    def ending(self) -> Optional[Literal["course-end", "diverged"]]: ...
    @property
    def scenario(self) -> Scenario: ...

@final
class Step:
    @property
    def torque_nm(self) -> float: ...
    @property
    def mode(self) -> str: ...
    @property
    def limit(self) -> str: ...
    @property
    def faults(self) -> tuple[str, ...]: ...
    @property
    def warning(self) -> bool: ...
    @property
    def permitted(self) -> bool: ...
    @property
    def frames(self) -> list[Frame]: ...

@final
class Ecu:
    def __init__(
        self,
        params: Optional[Union[dict[str, float], Scenario]] = None,
        *,
        engaged: bool = False,
        t_us: int = 0,
    ) -> None: ...
    def receive(self, id: int, data: Union[bytes, bytearray], t_us: int) -> Optional[str]: ...
    def step(self, t_us: int) -> Step: ...
    def clone(self) -> Ecu: ...

@final
INPUT_IDS: frozenset[int]
"""Identifiers of what the ECU hears."""

class Bus:
    def __init__(self) -> None: ...
    def lane_preview(
        self, e_y_m: float, e_theta_rad: float, *, age_us: int = 0, valid: bool = True
    ) -> Frame: ...
    def column(self, driver_torque_nm: float, wheel_angle_rad: float, motor_torque_nm: float) -> Frame: ...
    def vehicle(
        self,
        speed_m_per_s: float,
        second_speed_m_per_s: Optional[float] = None,
        yaw_rate_rad_per_s: Optional[float] = None,
    ) -> Frame: ...
    def request(self, engage: bool, *, authority: float = 1.0, probe: bool = False) -> Frame: ...
    def frames(
        self,
        t_us: int,
        *,
        e_y_m: Optional[float],
        e_theta_rad: Optional[float],
        driver_torque_nm: float,
        wheel_angle_rad: float,
        motor_torque_nm: float,
        speed_m_per_s: float,
        engage: bool = True,
        authority: float = 1.0,
        probe: bool = False,
        yaw_rate_rad_per_s: Optional[float] = None,
    ) -> list[Frame]: ...

def parameters() -> list[dict[str, Any]]: ...
def metric_definitions() -> list[dict[str, str]]: ...
def simulate(scenario: Scenario, record_bus: bool) -> dict[str, Any]: ...
def evaluate(
    scenario: Scenario, window_m: Optional[list[float]], progress: Optional[Callable[[int], object]]
) -> dict[str, Any]: ...
def identify(drives: list[Union[str, dict[str, np.ndarray]]], how: dict[str, Any]) -> dict[str, Any]: ...
def experiment(
    participants: list[int], probe_nm: float, seed: int, progress: Optional[Callable[[int], object]]
) -> dict[str, Any]: ...

@final
class Simulations:
    def __init__(self, count: int, seen: list[tuple[str, float]], told: list[str]) -> None: ...
    def begin(self, index: int, scenario: Scenario, seed: int) -> tuple[np.ndarray, list[float]]: ...
    def step_one(
        self, index: int, hand_torque_nm: float, authority: float, steps: int
    ) -> tuple[np.ndarray, list[float], list[float], int]: ...
    def step(
        self, hand_torque_nm: np.ndarray, authority: np.ndarray, active: np.ndarray, steps: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]: ...

@final
class Sweep:
    @staticmethod
    def load(path: Union[str, PathLike[str]]) -> Sweep: ...
    @staticmethod
    def from_text(text: str) -> Sweep: ...
    @property
    def text(self) -> str: ...
    @property
    def drives(self) -> int: ...
    @property
    def chunks(self) -> int: ...
    def missing(self, out: Union[str, PathLike[str]]) -> list[int]: ...
    def run_chunk(self, number: int) -> bytes: ...
    def stop(self) -> None: ...
    def put(self, out: Union[str, PathLike[str]], number: int, bytes: bytes) -> None: ...
    def finish(self, out: Union[str, PathLike[str]]) -> dict[str, Any]: ...
