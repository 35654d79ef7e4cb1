"""The shipping ECU around a vehicle of somebody else: the single-track and the multi-body model of the package
commonroad-vehicle-models.

The vehicle is a BMW 320i (its parameter set 2) at 60 km/h: a straight, a clothoid, a bend of 300 m radius. The single-track
model has 7 states, the multi-body model 29: three masses, springs, dampers, four wheels with Pacejka's tyres. The driver is equations (7) and (8) of the paper with little delay and medium reliance; the ECU boots as on a vehicle and
is asked for guidance after 0.6 s. What the ECU takes for granted of its vehicle is set to this one's.

    pip install haptic-guidance commonroad-vehicle-models
    python own_plant.py
"""

import math
from collections import deque

import numpy as np
from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st

import haptic_guidance as hg

STEP_S = 0.001
SPEED_M_PER_S = 60 / 3.6
K_T, J_S, B_S, TRAIL_M, K_S = 1 / 17, 0.11, 0.57, 0.026, 48_510.0  # steering of the paper's table 9
CAR = parameters_vehicle2()
LENGTH_M = CAR.a + CAR.b
# Cornering stiffness of the front axle, N/rad; that of the rear makes the car neutral.
C_F = -CAR.tire.p_ky1 * CAR.m * 9.81 * CAR.b / LENGTH_M
LEVER = TRAIL_M * C_F
K_ALN = LEVER * K_T / (1 + LEVER / K_S)
ECU_PARAMETERS = {
    "vehicle.curvature_gain_per_m": K_T / LENGTH_M,
    "vehicle.stability_factor_s2_per_m2": 0.0,
    "vehicle.aligning_gain_nm_s2_per_m": K_ALN * CAR.m * CAR.b / (LENGTH_M * C_F),
    "vehicle.column_damping_nm_s": B_S,
}


class Road:
    """A centreline with what a camera sees of it."""

    GRID_M = 0.1

    def __init__(self):
        s = np.arange(0.0, 700.0, self.GRID_M)
        self.heading = np.cumsum(np.interp(s, [0, 150, 230], [0, 0, 1 / 300])) * self.GRID_M
        self.x, self.y = (np.cumsum(f(self.heading)) * self.GRID_M for f in (np.cos, np.sin))

    def errors(self, x, y, direction, near_m, far_m):
        """Lateral error at a near point and heading error at a far point, both along the direction of movement."""
        near, far = (self.foot(x + d * math.cos(direction), y + d * math.sin(direction)) for d in (near_m, far_m))
        return -near[0], self.heading[far[1]] - direction

    def foot(self, x, y):
        """Offset from the centreline, left positive, and the place of the foot in the grid."""
        i = int(np.argmin((self.x - x) ** 2 + (self.y - y) ** 2))
        h = self.heading[i]
        return (y - self.y[i]) * math.cos(h) - (x - self.x[i]) * math.sin(h), i


class SingleTrack:
    """Position, direction of movement, and the slip angle of the front axle, which turns the wheel back."""

    def __init__(self):
        self.state = np.array([0.0, 0.0, 0.0, SPEED_M_PER_S, 0.0, 0.0, 0.0])

    def step(self, steering_rate):
        self.state += STEP_S * np.array(vehicle_dynamics_st(self.state, [steering_rate, 0.0], CAR))

    def place(self):
        x, y, _, _, yaw, _, slip = self.state
        return x, y, yaw + slip

    def front_slip(self):
        _, _, steering, _, _, yaw_rate, slip = self.state
        return slip + CAR.a * yaw_rate / SPEED_M_PER_S - steering


class MultiBody:
    """The same of the multi-body model; its speed is held as a driver's foot would."""

    def __init__(self):
        self.state = np.array(init_mb([0.0, 0.0, 0.0, SPEED_M_PER_S, 0.0, 0.0, 0.0], CAR))

    def step(self, steering_rate):
        throttle = 2.0 * (SPEED_M_PER_S - self.state[3])
        self.state += STEP_S * np.array(vehicle_dynamics_mb(self.state, [steering_rate, throttle], CAR))

    def place(self):
        state = self.state
        return state[0], state[1], state[4] + math.atan2(state[10], state[3])

    def front_slip(self):
        state = self.state
        return math.atan2(state[10] + CAR.a * state[5], state[3]) - state[2]


def drive(guided, vehicle=SingleTrack, duration_s=30.0):
    """Drives; returns the lateral error over time, m, and every fault that the ECU named, with its first time."""
    road, ecu, bus = Road(), hg.Ecu(ECU_PARAMETERS), hg.Bus()
    car = vehicle()
    k_d, k_nms, t_nms, k_hg = (3.0, 1.0, 0.1, 0.5) if guided else (4.0, 1.0, 0.1, 0.0)
    delayed = deque([0.0] * 100)  # t_p = 0.1 s
    wheel = wheel_rate = arm_nm = torque_nm = integral = 0.0
    error_m, faults = [], {}
    for k in range(int(duration_s / STEP_S)):
        t_us = 1000 * k
        if k % 8 == 0:  # driver and camera look
            x, y, direction = car.place()
            e_y, e_theta = road.errors(x, y, direction, 0.3 * SPEED_M_PER_S, 1.0 * SPEED_M_PER_S)
            seen = road.errors(x, y, direction, 0.3 * SPEED_M_PER_S, 0.7 * SPEED_M_PER_S)
            error_m.append(road.foot(x, y)[0])
        frames = bus.frames(
            t_us,
            e_y_m=seen[0],
            e_theta_rad=seen[1],
            driver_torque_nm=arm_nm,
            wheel_angle_rad=wheel,
            motor_torque_nm=torque_nm,
            speed_m_per_s=SPEED_M_PER_S,
            engage=guided and k >= 600,
        )
        for frame in frames:
            ecu.receive(*frame, t_us)
        step = ecu.step(t_us)
        torque_nm = step.torque_nm
        for fault in step.faults:
            faults.setdefault(fault, k * STEP_S)
        # The driver, the column, and the foreign car.
        integral += e_y * STEP_S
        delayed.append(0.1 * e_y + 0.05 * integral + 3.7 * e_theta)
        target = delayed.popleft()
        arm_nm += STEP_S / t_nms * ((k_d + k_nms) * target - k_nms * wheel - k_hg * torque_nm - arm_nm)
        wheel_rate += STEP_S / J_S * (arm_nm + torque_nm + K_ALN * car.front_slip() - B_S * wheel_rate)
        wheel += STEP_S * wheel_rate
        car.step(K_T * wheel_rate)
    return np.array(error_m), faults, step.mode


if __name__ == "__main__":
    for vehicle in (SingleTrack, MultiBody):
        for guided in (False, True):
            error_m, faults, mode = drive(guided, vehicle)
            name = f"{vehicle.__name__}, {'guided' if guided else 'unguided'}"
            print(f"{name}: peak {np.abs(error_m).max():.3f} m, mean {np.abs(error_m).mean():.3f} m, ECU in {mode}")
            print("  faults:", ", ".join(f"{fault} at {time_s:.3f} s" for fault, time_s in faults.items()) or "none")
