"""A driver of whom everything is known, on a vehicle that is not ours, and what the identification finds.

    python examples/python/identify_commonroad.py [st|mb] [--span S] [--seed N] [--csv OUT.csv --truth OUT.json]

The vehicle is one of the package commonroad-vehicle-models with its BMW 320i: `st`, the single-track model (7 states), or
`mb`, the multi-body model (29 states: roll, pitch, four wheels, a tyre after the magic formula). Road, column, guidance,
driver and remnant are written here from the equations of docs/explanation, with none of the workbench's code: steps of
1 ms by Runge-Kutta, T_h decided once a millisecond, rows at 60 Hz with the resolution of the paper's sensors.

With --csv the drive is only recorded: so tests/data/driver-logs/commonroad-*.csv were made.
"""

import argparse
import json
import math
import random

from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st

STEP_S, RATE_HZ, SPEED = 1e-3, 60, 60 / 3.6
TRUTH = {
    "a1": 0.11, "a2": 0.03, "a3": 3.9, "t_p": 0.16, "K_d": 3.1, "K_hg": 0.42, "K_nms": 1.0, "t_nms": 0.1,
    "remnant_sd": 0.06, "remnant_corner": 0.5,
}  # fmt: skip
STEERING_RATIO, J_S, B_S, ALIGNING = 1 / 17, 0.11, 0.57, 150.0
NEAR_S, FAR_S, GUIDANCE_FAR_S = 0.3, 1.0, 0.7
PROBE_NM, PROBE_HZ = 0.2, 2.5
COLUMNS = ["time_s", "e_y_m", "e_theta_rad", "wheel_angle_rad", "guidance_torque_nm", "driver_torque_nm"]


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


class Vehicle:
    """One of CommonRoad's models: its state, and what the loop needs of it."""

    def __init__(self, name):
        self.p = parameters_vehicle2()
        still = [0.0, 0.0, 0.0, SPEED, 0.0, 0.0, 0.0]
        self.many = name == "mb"
        self.start = [float(x) for x in init_mb(still, self.p)] if self.many else still

    def slopes(self, x, steering_rate):
        """Rates of the state; a cruise control keeps the speed."""
        inputs = [steering_rate, 2.0 * (SPEED - x[3])]
        return (vehicle_dynamics_mb if self.many else vehicle_dynamics_st)(list(x), inputs, self.p)

    def motion(self, x):
        """Front wheel angle, speed, yaw angle, yaw rate and sideslip."""
        if self.many:
            return x[2], math.hypot(x[3], x[10]), x[4], x[5], math.atan2(x[10], x[3])
        return x[2], x[3], x[4], x[5], x[6]


def drive(vehicle, span_s, seed):
    """Rows in the order of COLUMNS."""
    normal = random.Random(seed).gauss
    t, n = TRUTH, len(vehicle.start)
    gains = [(t["K_d"] + t["K_nms"]) * t[a] for a in ("a1", "a2", "a3")]
    rho = math.exp(-2 * math.pi * t["remnant_corner"] * STEP_S)
    kick = t["remnant_sd"] * math.sqrt(1 - rho * rho)
    # The vehicle's state, wheel angle, its rate, arm torque, s, offset from the road, direction against the road.
    x = vehicle.start + [0.0, 0.0, 0.0, 0.0, 0.2, 0.0]
    remnant, t_h, integral = normal(0, t["remnant_sd"]), 0.0, 0.0
    seen, rows = [], []
    late = t["t_p"] / STEP_S

    def errors(x):
        s, off, angle = x[n + 3 :]
        heading, offset = bend(s, NEAR_S * SPEED)
        far, _ = bend(s, FAR_S * SPEED)
        return offset - off - NEAR_S * SPEED * angle, far - angle

    def slopes(x, target, t_h, remnant):
        wheel, rate, arm, s, off, angle = x[n:]
        delta, speed, _, yaw_rate, sideslip = vehicle.motion(x)
        inside = vehicle.slopes(x[:n], STEERING_RATIO * rate)
        slip = delta - sideslip - vehicle.p.a * yaw_rate / speed
        acceleration = (arm + remnant + t_h - ALIGNING * slip - B_S * rate) / J_S
        arm_rate = (target - t["K_hg"] * t_h - t["K_nms"] * wheel - arm) / t["t_nms"]
        along = speed * math.cos(angle) / (1 - off * curvature(s))
        # d/dt of the direction of motion: yaw rate and the rate of the sideslip.
        if vehicle.many:
            turning = yaw_rate + (x[3] * inside[10] - x[10] * inside[3]) / (speed * speed)
        else:
            turning = yaw_rate + inside[6]
        return [*inside, rate, acceleration, arm_rate, along, speed * math.sin(angle), turning - curvature(s) * along]

    def moved(x, by, rates):
        return [a + by * b for a, b in zip(x, rates)]

    def delayed(k):
        place = max(k - late, 0.0)
        whole = int(place)
        a, b = seen[whole], seen[min(whole + 1, len(seen) - 1)]
        return sum(g * (u + (place - whole) * (v - u)) for g, u, v in zip(gains, a, b))

    last = None
    for k in range(int(span_s / STEP_S)):
        e_y, e_theta = errors(x)
        if seen:
            integral += 0.5 * STEP_S * (e_y + seen[-1][0])
        seen.append((e_y, integral, e_theta))
        held = t_h
        far, _ = bend(x[n + 3], GUIDANCE_FAR_S * SPEED)
        t_h = 0.25 * e_y + 4.0 * (far - x[n + 5]) + PROBE_NM * math.sin(2 * math.pi * PROBE_HZ * k * STEP_S)
        now = (k, e_y, e_theta, x[n], x[n + 2] + remnant)
        # Rows between the last step and this one; T_h is what was held until then, or new at its own instant.
        while last is not None and len(rows) / RATE_HZ <= k * STEP_S + 1e-12:
            at = len(rows) / RATE_HZ / STEP_S
            share = at - last[0]
            e_y_then, e_theta_then, wheel, t_d = (a + share * (b - a) for a, b in zip(last[1:], now[1:]))
            torque = t_h if share > 1 - 1e-9 else held
            rows.append([len(rows) / RATE_HZ, e_y_then, e_theta_then, wheel, torque, 0.005 * round(t_d / 0.005)])
        last = now
        target = [delayed(k + d) for d in (0.0, 0.5, 1.0)]
        k1 = slopes(x, target[0], t_h, remnant)
        k2 = slopes(moved(x, 0.5 * STEP_S, k1), target[1], t_h, remnant)
        k3 = slopes(moved(x, 0.5 * STEP_S, k2), target[1], t_h, remnant)
        k4 = slopes(moved(x, STEP_S, k3), target[2], t_h, remnant)
        x = [a + STEP_S / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4)]
        remnant = rho * remnant + kick * normal(0, 1)
    return rows


def truths():
    """What the identification should find."""
    gain = TRUTH["K_d"] + TRUTH["K_nms"]
    found = {f"gain_{i}": gain * TRUTH[f"a{i}"] for i in (1, 2, 3)}
    return found | {"t_p": TRUTH["t_p"], "k_hg": TRUTH["K_hg"]}


def identified(rows):
    """The fit of a drive's rows."""
    import haptic_guidance as hg

    columns = {name: [row[i] for row in rows] for i, name in enumerate(COLUMNS)}
    return hg.identify(columns)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", nargs="?", choices=["st", "mb"], default="st")
    parser.add_argument("--span", type=float, default=150.0, help="length of the drive, s")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--csv", help="record only: the drive")
    parser.add_argument("--truth", help="with --csv: the driver")
    asked = parser.parse_args()
    rows = drive(Vehicle(asked.model), asked.span, asked.seed)
    if asked.csv:
        with open(asked.csv, "w", encoding="utf-8") as file:
            file.write(f"# CommonRoad {asked.model} BMW 320i; examples/python/identify_commonroad.py\n{','.join(COLUMNS)}\n")
            for time, e_y, e_theta, wheel, t_h, t_d in rows:
                file.write(f"{time:.6f},{e_y:.6f},{e_theta:.7f},{wheel:.6f},{t_h:.6f},{t_d:.3f}\n")
        if asked.truth:
            with open(asked.truth, "w", encoding="utf-8") as file:
                file.write(json.dumps(TRUTH, indent=1) + "\n")
        return
    fit = identified(rows)
    for name, truth in truths().items():
        p = fit[name]
        low, high = p.interval_95
        held = "holds" if low <= truth <= high else "MISSES"
        print(f"{name:8}{p.optimum:9.4f}  {low:8.4f} to {high:8.4f}  {held} the truth {truth:.4f}")
    for refuted in fit.refuted:
        print(refuted)


if __name__ == "__main__":
    main()
