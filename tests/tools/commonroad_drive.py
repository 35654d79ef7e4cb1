"""A drive on a vehicle that is not ours, with a known driver: the single-track vehicle of CommonRoad.

    pip install commonroad-vehicle-models numpy
    python3 tests/tools/commonroad_drive.py OUT.csv TRUTH.json [SEED]

The vehicle is `vehicle_dynamics_st` of the package commonroad-vehicle-models with its BMW 320i. Road, column, guidance,
driver and remnant are written here from the equations of docs/numerics.md, with none of the workbench's code: steps of
1 ms by Runge-Kutta, T_h decided once a millisecond, rows at 60 Hz with the resolution of the paper's sensors.
"""
import json
import math
import sys

import numpy as np
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st

STEP_S, RATE_HZ, SPAN_S, SPEED = 1e-3, 60, 150.0, 60 / 3.6
TRUTH = {
    "a1": 0.11, "a2": 0.03, "a3": 3.9, "t_p": 0.16, "K_d": 3.1, "K_hg": 0.42, "K_nms": 1.0, "t_nms": 0.1,
    "remnant_sd": 0.06, "remnant_corner": 0.5,
}
STEERING_RATIO, J_S, B_S, ALIGNING = 1 / 17, 0.11, 0.57, 150.0
NEAR_S, FAR_S, GUIDANCE_FAR_S = 0.3, 1.0, 0.7
PROBE_NM, PROBE_HZ = 0.2, 2.5


def curvature(s):
    """A winding road: three waves that never repeat within the drive, 1 m/s2 at most."""
    return 0.0013 * math.sin(s / 41) + 0.0011 * math.sin(s / 97 + 1) + 0.0009 * math.sin(s / 230 + 2)


def bend(s, ahead):
    """Heading and offset of the road `ahead` of s, from the tangent at s."""
    heading = offset = 0.0
    n = 8
    for k in range(n):
        c = curvature(s + (k + 0.5) * ahead / n) * ahead / n
        heading += c
        offset += c * (ahead - (k + 0.5) * ahead / n)
    return heading, offset


def drive(seed):
    random = np.random.default_rng(seed)
    p = parameters_vehicle2()
    t = TRUTH
    gains = [(t["K_d"] + t["K_nms"]) * t[a] for a in ("a1", "a2", "a3")]
    steps = int(SPAN_S / STEP_S)
    rho = math.exp(-2 * math.pi * t["remnant_corner"] * STEP_S)
    kick = t["remnant_sd"] * math.sqrt(1 - rho * rho)
    # Vehicle (x, y, delta, v, psi, r, beta), wheel angle, its rate, arm torque, s, offset from the road, its angle.
    x = np.array([0, 0, 0, SPEED, 0, 0, 0, 0, 0, 0, 0, 0.2, 0], dtype=float)
    remnant, t_h, integral = random.normal() * t["remnant_sd"], 0.0, 0.0
    seen, rows = [], []
    late = t["t_p"] / STEP_S

    def errors(x):
        heading, offset = bend(x[10], NEAR_S * SPEED)
        far, _ = bend(x[10], FAR_S * SPEED)
        return offset - x[11] - NEAR_S * SPEED * x[12], far - x[12]

    def slopes(x, target, t_h, remnant):
        vehicle = vehicle_dynamics_st(list(x[:7]), [STEERING_RATIO * x[8], 0.0], p)
        slip = x[2] - x[6] - p.a * x[5] / SPEED
        torque = x[9] + remnant
        rate = (torque + t_h - ALIGNING * slip - B_S * x[8]) / J_S
        arm = (target - t["K_hg"] * t_h - t["K_nms"] * x[7] - x[9]) / t["t_nms"]
        along = SPEED / (1 - x[11] * curvature(x[10]))
        direction = vehicle[4] + vehicle[6]
        return np.array(list(vehicle) + [
            x[8], rate, arm, along, SPEED * math.sin(x[12]), direction - curvature(x[10]) * along])

    def delayed(k):
        place = max(k - late, 0.0)
        whole = int(place)
        a, b = seen[whole], seen[min(whole + 1, len(seen) - 1)]
        return [u + (place - whole) * (v - u) for u, v in zip(a, b)]

    last = None
    for k in range(steps):
        e_y, e_theta = errors(x)
        if seen:
            integral += 0.5 * STEP_S * (e_y + seen[-1][0])
        seen.append((e_y, integral, e_theta))
        held = t_h
        guidance_far, _ = bend(x[10], GUIDANCE_FAR_S * SPEED)
        t_h = 0.25 * e_y + 4.0 * (guidance_far - x[12]) + PROBE_NM * math.sin(2 * math.pi * PROBE_HZ * k * STEP_S)
        now = (k, e_y, e_theta, x[7], x[9] + remnant)
        # Rows between the last step and this one; T_h is what was held until then, or new at its own instant.
        while last is not None and len(rows) / RATE_HZ <= k * STEP_S + 1e-12:
            at = len(rows) / RATE_HZ / STEP_S
            share = at - last[0]
            row = [a + share * (b - a) for a, b in zip(last[1:], now[1:])]
            torque = t_h if share > 1 - 1e-9 else held
            rows.append([len(rows) / RATE_HZ, row[0], row[1], row[2], torque, row[3]])
        last = now
        target = [sum(g * u for g, u in zip(gains, delayed(k + d))) for d in (0.0, 0.5, 1.0)]
        k1 = slopes(x, target[0], t_h, remnant)
        k2 = slopes(x + 0.5 * STEP_S * k1, target[1], t_h, remnant)
        k3 = slopes(x + 0.5 * STEP_S * k2, target[1], t_h, remnant)
        k4 = slopes(x + STEP_S * k3, target[2], t_h, remnant)
        x = x + STEP_S / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        remnant = rho * remnant + kick * random.normal()
    return rows


def main():
    rows = drive(int(sys.argv[3]) if len(sys.argv) > 3 else 1)
    with open(sys.argv[1], "w", encoding="utf-8") as f:
        f.write("# CommonRoad single-track BMW 320i; tests/tools/commonroad_drive.py\n")
        f.write("time_s,e_y_m,e_theta_rad,wheel_angle_rad,guidance_torque_nm,driver_torque_nm\n")
        for time, e_y, e_theta, angle, t_h, t_d in rows:
            f.write(f"{time:.6f},{e_y:.6f},{e_theta:.7f},{angle:.6f},{t_h:.6f},{0.005 * round(t_d / 0.005):.3f}\n")
    with open(sys.argv[2], "w", encoding="utf-8") as f:
        json.dump(TRUTH, f, indent=1)
        f.write("\n")


if __name__ == "__main__":
    main()
