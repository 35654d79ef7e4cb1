"""Two manoeuvres of CommonRoad's vehicles, as a table for haptic-sim's test `models::nonlinear`.

The PyPI package `commonroad-vehicle-models` (BSD), its `vehicle_dynamics_st` and `vehicle_dynamics_mb` (29 states, with
suspension and PAC2002 tyres) with parameter set 2 (a BMW 320i), integrated by the classical Runge-Kutta method with 1 ms.
The wheels are steered as `steering` says, in a lane change and in a curve of 2.5 m/s^2.

    python3 -m venv target/venv && target/venv/bin/pip install commonroad-vehicle-models==3.0.2
    target/venv/bin/python tests/tools/commonroad_vehicles.py > tests/data/commonroad_vehicles.csv
"""

import math

from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st

STEP = 0.001
# Name, speed (m/s), largest angle of the front wheels (rad).
MANOEUVRES = [("lane_change", 25.0, 0.0105), ("curve", 15.0, 0.0287)]


def steering(name, largest, t):
    """Angle of the front wheels at a time, and its rate."""
    if name == "lane_change":
        w = 2 * math.pi / 4.0
        return (largest * math.sin(w * t), largest * w * math.cos(w * t)) if t < 4.0 else (0.0, 0.0)
    # A half cosine of 2 s, then held.
    w = math.pi / 2.0
    if t < 2.0:
        return 0.5 * largest * (1 - math.cos(w * t)), 0.5 * largest * w * math.sin(w * t)
    return largest, 0.0


def single_track(speed):
    """Rates, start and motion (yaw rate, side-slip angle) of the single-track vehicle."""
    start = [0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0]
    return vehicle_dynamics_st, start, lambda x: (x[5], x[6])


def multi_body(speed):
    """The same of the multi-body vehicle, whose state 10 is the lateral speed of its centre of gravity."""
    start = init_mb([0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0], parameters_vehicle2())
    return vehicle_dynamics_mb, start, lambda x: (x[5], math.atan2(x[10], x[3]))


def main():
    p = parameters_vehicle2()
    print("vehicle,manoeuvre,time_s,speed_m_per_s,front_wheel_rad,yaw_rate_rad_per_s,sideslip_rad")
    for vehicle in [single_track, multi_body]:
        for name, speed, largest in MANOEUVRES:
            dynamics, x, motion = vehicle(speed)

            def rates(x, t):
                angle, rate = steering(name, largest, t)
                return dynamics([x[0], x[1], angle, *x[3:]], [rate, 0.0], p)

            for step in range(6000):
                t = step * STEP
                if step % 20 == 0:
                    yaw_rate, sideslip = motion(x)
                    angle = steering(name, largest, t)[0]
                    row = f"{t:.3f},{speed},{angle:.9g},{yaw_rate:.9g},{sideslip:.9g}"
                    print(f"{vehicle.__name__},{name},{row}")
                k1 = rates(x, t)
                k2 = rates([a + 0.5 * STEP * b for a, b in zip(x, k1)], t + 0.5 * STEP)
                k3 = rates([a + 0.5 * STEP * b for a, b in zip(x, k2)], t + 0.5 * STEP)
                k4 = rates([a + STEP * b for a, b in zip(x, k3)], t + STEP)
                x = [a + STEP / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4)]


if __name__ == "__main__":
    main()
