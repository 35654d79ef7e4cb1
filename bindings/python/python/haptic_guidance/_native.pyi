from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, Final, Literal, Optional, Union, final

import numpy as np
from typing_extensions import Required, TypedDict, Unpack

# The tables of a scenario are made of the lists of fields: FIELDS=write cargo test -p host-sim file_fields::

class SpeedTable(TypedDict, total=False):
    time_s: Sequence[float]
    place_m: Sequence[float]
    speed_m_per_s: Sequence[float]
    speed_kmh: Sequence[float]

class SegmentTable(TypedDict, total=False):
    length_m: Required[float]
    curvature_per_m: float
    curvature_start_per_m: float
    curvature_end_per_m: float
    bank_rad: float
    bank_start_rad: float
    bank_end_rad: float
    grade: float
    grade_start: float
    grade_end: float

class CourseTable(TypedDict, total=False):
    name: str
    lane_width_m: float
    segment: Sequence[SegmentTable]
    opendrive: str

class DriverTable(TypedDict, total=False):
    a_1_rad_per_m: float
    a_2_rad_per_m_s: float
    a_3: float
    t_p_s: float
    t_n_s: float
    t_f_s: float
    t_nms_s: float
    k_nms_nm_per_rad: float
    remnant_sd_nm: float
    remnant_corner_hz: float
    answers_hands_off_after_s: float
    takes_over_after_s: float
    line_m: float
    k_d_nm_per_rad: float
    k_hg: float
    manual_k_d_nm_per_rad: float

class VehicleTable(TypedDict, total=False):
    m_kg: float
    i_kg_m2: float
    l_f_m: float
    l_r_m: float
    k_f_n_per_rad: float
    k_r_n_per_rad: float
    k_s_nm_per_rad: float
    e_t_m: float
    b_s_nms_per_rad: float
    j_s_kg_m2: float
    k_t: float

class GuidanceTable(TypedDict, total=False):
    k_1_nm: float
    a_1_per_m: float
    a_2_s_per_m: float
    a_3_per_rad: float
    a_4_s_per_rad: float
    rate_corner_hz: float
    torque_limit_nm: float
    wind_up_nm_per_s: float
    reduction_nm_per_s: float
    least_speed_m_per_s: float
    probe_amplitude_nm: float
    probe_frequency_hz: float
    low_speed_share: float
    high_speed_share: float
    law: float
    activity_lambda_min: float
    torque_sensor: float
    wheel_inertia_kg_m2: float
    wheel_damping_nm_s_nms_per_rad: float
    wheel_friction_nm: float
    bar_stiffness_nm_per_rad: float
    column_period_s: float
    observer_bandwidth_rad_per_s: float
    t_n_s: float
    t_f_s: float
    probe: bool

class FailureTable(TypedDict, total=False):
    kind: Literal["none", "torque", "input"]
    time_s: float
    duration_s: float

class DriverChangeTable(TypedDict):
    time_s: float
    k_d_nm_per_rad: float
    k_hg: float

class WorldTable(TypedDict, total=False):
    tyres: Literal["linear", "saturating"]
    mu: float
    castor_share: float
    bank_rad: float
    friction_nm: float
    friction_give_rad: float
    assist_nm: float
    assist_speed_m_per_s: float
    motor_lag_s: float
    motor_error: float
    motor_ripple_nm: float
    wind_n: float
    gust_sd_n: float
    gust_corner_hz: float
    wind_lever_m: float

class SensorErrorsTable(TypedDict, total=False):
    torque_bias_nm: float
    torque_gain: float
    angle_bias_rad: float
    speed_gain: float
    yaw_rate_bias_rad_per_s: float
    yaw_rate_gain: float
    yaw_rate_noise_rad_per_s: float
    lane_noise_m: float
    heading_noise_rad: float
    camera_yaw_rad: float
    camera_latency_s: float
    camera_jitter_s: float
    dropout_rate_per_s: float
    dropout_duration_s: float
    line_jump_rate_per_s: float
    line_jump_m: float

class TolerancesTable(TypedDict, total=False):
    car: int
    tyres: float
    trail: float
    load_kg: float
    friction_least_nm: float
    friction_most_nm: float
    motor_error: float
    motor_lag_s: float
    torque_bias_nm: float
    torque_gain: float
    angle_bias_rad: float
    speed_gain: float
    camera_yaw_rad: float
    yaw_rate_bias_rad_per_s: float

class ColumnTable(TypedDict, total=False):
    kind: Literal["rigid", "torsion-bar"]
    j_w_kg_m2: float
    b_w_nms_per_rad: float
    k_tb_nm_per_rad: float
    b_tb_nms_per_rad: float
    upper_friction_nm: float
    lower_friction_nm: float
    friction_give_rad: float
    sensor_range_nm: float
    sensor_resolution_nm: float
    sensor_noise_nm: float
    sensor_offset_nm: float
    sensor_lag_s: float
    angle: Literal["wheel", "column"]
    fault: Literal["none", "sensor-offset", "sensor-drift", "sensor-stuck", "sensor-doubled", "broken-bar", "assist-lost", "assist-runaway"]
    fault_time_s: float

class CurveTable(TypedDict):
    torque_nm: list[float]
    speed_m_per_s: list[float]
    assist_nm: list[list[float]]

class AssistTable(TypedDict, total=False):
    inject: Literal["overlay", "offset"]
    lead_s: float
    lag_s: float
    motor_lag_s: float
    limit_nm: float
    curve: Union[Literal["none", "light", "medium", "strong"], CurveTable]

class ScenarioFields(TypedDict, total=False):
    course: Union[str, PathLike[str], CourseTable]
    road: str
    lane: int
    turn: list[str]
    speed_m_per_s: float
    speed_kmh: float
    speed: SpeedTable
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
    column: ColumnTable
    assist: AssistTable

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
    speed_kmh: Final[float]
    speed_m_per_s: Final[float]
    condition: Final[str]
    k_d: Final[float]
    k_hg: Final[float]
    t_p_s: Final[float]
    failure_time_s: Final[Optional[float]]
    course_name: Final[str]
    course_length_m: Final[float]
    lane_width_m: Final[float]
    duration_s: Final[float]
    seed: Final[int]

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
    id: Final[int]
    data: Final[bytes]
    def __iter__(self) -> Iterator[Any]: ...
    def __hash__(self) -> int: ...

@final
class Outcome:
    time_s: Final[float]
    e_y_m: Final[float]
    e_theta_rad: Final[float]
    driver_torque_nm: Final[float]
    wheel_angle_rad: Final[float]
    decided_torque_nm: Final[float]
    guidance_torque_nm: Final[float]
    guidance_limited: Final[bool]
    mode: Final[Optional[str]]
    faults: Final[tuple[str, ...]]
    warning: Final[bool]
    k_hg: Final[Optional[tuple[float, float]]]
    unguided: Final[Optional[str]]
    sample: Final[Optional[dict[str, float]]]
    frames_in: Final[list[Frame]]
    frames_out: Final[list[Frame]]

@final
class DriverView:
    step: Final[int]
    time_s: Final[float]
    e_y_m: Final[float]
    e_theta_rad: Final[float]
    near_m: Final[float]
    far_m: Final[float]
    wheel_angle_rad: Final[float]
    wheel_rate_rad_per_s: Final[float]
    speed_m_per_s: Final[float]
    yaw_rate_rad_per_s: Final[float]
    guidance_torque_nm: Final[float]
    warning: Final[bool]
    asks_for_hands: Final[bool]

@final
class LawView:
    step: Final[int]
    e_y_m: Final[float]
    e_y_rate_m_per_s: Final[float]
    e_theta_rad: Final[float]
    e_theta_rate_rad_per_s: Final[float]
    driver_torque_nm: Final[float]
    wheel_angle_rad: Final[float]
    wheel_rate_rad_per_s: Final[float]
    guidance_torque_nm: Final[float]
    speed_m_per_s: Final[float]
    yaw_rate_rad_per_s: Final[float]
    k_hg: Final[Optional[float]]

@final
class Simulation:
    def __init__(self, scenario: Scenario, own_driver: bool = False) -> None: ...
    def view(self) -> Optional[DriverView]: ...
    def step(self, action: Optional[Action] = None, steps: int = 1) -> Optional[Outcome]: ...
    def clone(self) -> Simulation: ...
    steps: Final[int]
    ending: Final[Optional[Literal["course-end", "diverged"]]]
    scenario: Final[Scenario]

@final
class Step:
    torque_nm: Final[float]
    mode: Final[str]
    limit: Final[str]
    faults: Final[tuple[str, ...]]
    warning: Final[bool]
    permitted: Final[bool]
    frames: Final[list[Frame]]

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

__version__: str
"""The version of this package."""
INPUT_IDS: frozenset[int]
"""Identifiers of what the ECU hears."""

@final
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
def compare(
    path: Union[str, PathLike[str]],
    laws: dict[str, Callable[..., Any]],
    drivers: dict[str, Callable[..., Any]],
    threads: Optional[int],
    progress: Optional[Callable[[int], object]],
) -> dict[str, Any]: ...
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
    text: Final[str]
    drives: Final[int]
    chunks: Final[int]
    def missing(self, out: Union[str, PathLike[str]]) -> list[int]: ...
    def run_chunk(self, number: int) -> bytes: ...
    def stop(self) -> None: ...
    def put(self, out: Union[str, PathLike[str]], number: int, bytes: bytes) -> None: ...
    def finish(self, out: Union[str, PathLike[str]]) -> dict[str, Any]: ...
