"""The identification of one log with SciPy, beside the workbench's, to the same loss in the same run.

    python3 bench/identify.py LOG.csv

The problem is that of host-sim/analysis/src/identify/noise_model, written as a researcher writes it: a residual function in
NumPy (the lag by lfilter, the delay by interpolation, the disturbance by lfilter), given to
scipy.optimize.least_squares with its default finite differences. Prints one JSON object. Needs numpy and scipy, and
builds the workbench by cargo. Exit code 1: the two do not reach the same loss or K_hg.
"""
import csv
import json
import os
import subprocess
import sys
import time

# One core, as ours.
os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

K_NMS, T_NMS, LONGEST_DELAY = 1.0, 0.1, 0.6


def lines(u):
    out = u.copy()
    out[1:-1] -= (u[:-2] - 2 * u[1:-1] + u[2:]) / 12
    return out


class Problem:
    def __init__(self, path):
        with open(path, encoding="utf-8") as f:
            rows = list(csv.DictReader(f))
        column = {k: np.array([float(r[k]) for r in rows]) for k in rows[0]}
        t = column["time_s"]
        self.dt = (t[-1] - t[0]) / (len(t) - 1)
        e_y = lines(column["e_y_m"])
        integral = np.concatenate([[0], np.cumsum((e_y[1:] + e_y[:-1]) * self.dt / 2)])
        self.visual = [e_y, integral, lines(column["e_theta_rad"])]
        guidance = column["guidance_torque_nm"]
        self.manual = not guidance.any()
        self.guidance = self.lagged_guidance(guidance, t[0] + self.dt * np.arange(len(t)))
        phi = self.lag(lines(column["wheel_angle_rad"]))
        self.target = column["driver_torque_nm"] + K_NMS * phi
        self.lagged = [self.lag(u) for u in self.visual]
        self.first = int(np.ceil((LONGEST_DELAY + 5 * T_NMS) / self.dt))

    def weights(self, tau):
        decay = np.exp(-tau / T_NMS)
        w1 = tau / self.dt - T_NMS / self.dt * (1 - decay)
        return decay, 1 - decay - w1, w1

    def lag(self, u, held=None):
        decay, w0, w1 = self.weights(self.dt)
        end = u[1:].copy()
        if held is not None:
            end[held] = u[:-1][held]
        drive = w0 * u[:-1] + w1 * end
        return np.concatenate([[u[0]], lfilter([1], [1, -decay], drive, zi=[decay * u[0]])[0]])

    def lagged_guidance(self, torque, t):
        """A probe's steps are held up to the sample; the rest belongs to the middle of the ECU's millisecond."""
        rise = np.diff(torque)
        switched = np.abs(rise) > 8 * self.dt
        steps = np.concatenate([[0], np.cumsum(np.where(switched, rise, 0))])
        rest = torque - steps
        slope = np.concatenate([[rest[1] - rest[0]], (rest[2:] - rest[:-2]) / 2, [rest[-1] - rest[-2]]]) / self.dt
        ticks = t / 1e-3
        age = ticks - np.floor(ticks + 0.1)
        return self.lag(lines(rest + slope * (age - 0.5) * 1e-3)) + self.lag(steps, switched)

    def residual(self, p):
        # A manual drive has no K_hg.
        *gain, k_hg, offset, t_p, rho, theta = np.insert(p, 3, 0.0) if self.manual else p
        whole = int(np.ceil(t_p / self.dt))
        decay, w0, w1 = self.weights(whole * self.dt - t_p)
        j = np.arange(self.first, len(self.target)) - whole
        after = np.minimum(j + 1, len(self.target) - 1)
        model = offset - k_hg * self.guidance[self.first:]
        for g, u, m in zip(gain, self.visual, self.lagged):
            model = model + g * (decay * m[j] + w0 * u[j] + w1 * u[after])
        n = self.target[self.first:] - model
        # Begun as if the first row had gone on for ever.
        e0 = (1 - rho) / (1 - theta) * n[0]
        return lfilter([1, -rho], [1, -theta], n, zi=[theta * e0 - rho * n[0]])[0]


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    path = sys.argv[1]
    command = ["cargo", "run", "--profile", "dist", "-q", "-p", "host-sim", "--example", "time_identification", "--", path]
    ours = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    problem = Problem(path)
    rho = np.exp(-np.pi * problem.dt)
    # gain_1, gain_2, gain_3, K_hg, offset, t_p, rho, theta
    start = np.array([0.4, 0.04, 14.8, 0.5, 0, 0.1, rho, 0.01])
    low = np.array([-np.inf, -np.inf, -np.inf, 0, -np.inf, 0, 0, 0])
    high = np.array([np.inf, np.inf, np.inf, 1, np.inf, LONGEST_DELAY, 0.99999, 0.99])
    if problem.manual:
        start, low, high = (np.delete(x, 3) for x in (start, low, high))
    began = time.process_time()
    fit = least_squares(problem.residual, start, bounds=(low, high), x_scale="jac", ftol=1e-10, xtol=1e-10)
    seconds = time.process_time() - began
    print(json.dumps({
        "rows": len(problem.target),
        "loss": ours["loss"], "scipy_loss": fit.cost,
        "t_p": ours["t_p"], "scipy_t_p": fit.x[-3],
        "k_hg": ours["k_hg"], "scipy_k_hg": None if problem.manual else fit.x[3],
        "seconds": ours["noise_model_seconds"], "scipy_seconds": seconds,
        "times_faster": seconds / ours["noise_model_seconds"],
        "with_camera_noise_seconds": ours["noise_model_with_camera_noise_seconds"],
        "paper_method_seconds": ours["paper_seconds"],
    }, indent=2))
    return 0 if abs(fit.cost / ours["loss"] - 1) < 1e-4 else 1


if __name__ == "__main__":
    sys.exit(main())
