"""How little a handover can cost at one instant: the best of all torques that an ECU could apply, by linear programs.

Responsible for: the bound in docs/decisions/001. The loop is closed_loop.py's for small angles, in the lane's frame, so that errors are
linear in the torque after the failure. The programs seek the fall whose worst peak beside a drop's is least, while no driver's peak
exceeds what the line of 2 s leaves, times `none_worse_than`. A fall is a share of the torque before: one for all drivers, until
`knows_after_s` after one took over (none: for ever). It never grows, unless it `may_swing`. The road is known, which it is to no ECU.

Not here: frames, noise, the extrapolated lane (the law sees the true one), several instants at once.

    target/venv/bin/python bench/handover.py
"""

import argparse
import json

import numpy as np
from scipy.optimize import linprog

import closed_loop as paper

GAINS = {"high": (2.0, 0.0), "mid": (3.0, 0.5), "by hand": (paper.MANUAL_K_D, 0.0)}
STEP, AFTER, SWINGS = 0.05, 8.0, 8.0  # s between knots of a torque, s in which the peak counts, N.m/s at most
BEFORE, CLOTHOID, ARC = 6.0, 80 / 300, 6.0  # s of straight, radii, s: the bends of `cargo xtask handover`


def drive(o, t_p, gains, takes_over, torque):
    """Lateral errors of drives side by side, at every tick. `torque` of the time since the failure and of the law's is what acts."""
    v, tick, steps, columns = o.speed / 3.6, paper.TICK, round((o.fails + AFTER) / paper.TICK), np.arange(len(t_p))
    paper.V = v
    (a, b), (k_d, k_hg), delays = paper.discretise(), np.transpose(gains), np.round(np.divide(t_p, tick)).astype(int)
    corners = BEFORE + np.cumsum([0, o.clothoid, ARC, o.clothoid])
    theta = np.cumsum(v * tick * np.interp(np.arange(steps + 1000) * tick, corners, np.array([0, 1, 1, 0]) / o.radius))
    along = np.cumsum(v * tick * theta)
    x, y, integral, before, rates, seen = np.zeros((6, len(t_p))), *np.zeros((3, len(t_p))), 0.0, None
    target, errors = np.zeros((2, steps, len(t_p)))
    for k in range(steps):
        chi = x[5] + x[0] - theta[k]
        near, guide_near = (along[k + round(t / tick)] - along[k] - v * t * (theta[k] + chi) - y for t in (paper.T_N, paper.GUIDE_T_N))
        far, guide_far = (theta[k + round(t / tick)] - theta[k] - chi for t in (paper.T_F, paper.GUIDE_T_F))
        integral, before, errors[k] = integral + 0.5 * tick * (before + near) * (k > 0), near, y
        target[k] = paper.A1 * near + paper.A2 * integral + paper.A3 * far
        new = np.stack((guide_near, guide_far))
        rates = rates + 2 * np.pi * paper.RATE_CORNER * (new - (new if seen is None else seen) - tick * rates)
        seen, since = new, k * tick - o.fails
        t_h = torque(since, paper.LAW_GAINS @ np.stack((new[0], rates[0], new[1], rates[1])))
        is_manual = since >= takes_over - 1e-9
        asked = np.where(is_manual, paper.MANUAL_K_D, k_d) + paper.K_NMS
        asked = [asked * target[np.maximum(k + i - delays, 0), columns] - np.where(is_manual, 0, k_hg) * t_h for i in (0, 1)]
        x, y = a @ x + b @ np.stack((*asked, t_h)), y + v * tick * chi
    return errors


def peaks_and_responses(o):
    """Of every driver: peaks of the line and a drop, the usual one; errors after a drop, a knot's effect on them; the torque before."""
    knots, drivers, lasting = round(o.lasts / STEP) + 1, [(t_p, GAINS[name]) for t_p in o.t_p for name in o.reliance], len(o.takes_over)
    # Of each driver: without a failure, by hand, the line, a drop and a hat of torque at each knot.
    kinds = np.repeat([0, 1, 2, 3], [1, 1, lasting, lasting * (knots + 1)])
    hats = np.vstack((np.zeros((2 + lasting, knots)), np.tile(np.eye(knots + 1, knots, -1), (lasting, 1))))
    kind, hats, held = np.tile(kinds, len(drivers)), np.tile(hats, (len(drivers), 1)), {}
    takes_over = np.tile(np.concatenate(([np.inf] * 2, o.takes_over, np.repeat(o.takes_over, knots + 1))), len(drivers))
    gains = [GAINS["by hand"] if kind == 1 else gains for _, gains in drivers for kind in kinds]

    def torque(since, law):
        held["began"] = law if since < 0 else held["began"]
        held["line"] = law if since < 1 else held["line"]
        hat = held["began"] * (hats @ np.maximum(0, 1 - np.abs(since / STEP - np.arange(knots))))
        return np.where((kind == 0) | (since < 0), law, np.where(kind == 2, held["line"] * max(0, 1 - since / 2), hat)) * (kind != 1)

    errors = drive(o, np.repeat([t_p for t_p, _ in drivers], len(kinds)), gains, takes_over, torque)
    failed = round(o.fails / paper.TICK)
    for own, began in zip(np.split(errors, len(drivers), 1), np.split(held["began"], len(drivers))):
        usual, line = np.abs(own[:, kinds < 2]).max(), np.abs(own[failed:, kinds == 2]).max(axis=0)
        own = own[failed :: round(0.08 / paper.TICK), kinds == 3].reshape(-1, lasting, knots + 1)
        drop, response = own[:, :, 0], own[:, :, 1:] - own[:, :, :1]
        yield np.maximum(line, usual), np.maximum(np.abs(drop).max(axis=0), usual), usual, drop, response, began[0]


def least(o, found, may_swing, knows_after_s, none_worse_than):
    """The least worst ratio to the drop; none where no fall keeps what the line leaves times `none_worse_than`."""
    drivers, knots = found[0][4].shape[1:]
    rows, limits, most = [], [], paper.TORQUE_LIMIT / max(abs(own[-1]) for own in found)
    for driver, takes_over_s in enumerate(o.takes_over):
        # Until a driver is known the fall is everybody's, which stands in the last driver's place.
        place = np.where(np.arange(knots) * STEP > takes_over_s + (knows_after_s or np.inf), driver, drivers - 1)
        acts = np.eye(drivers * knots)[place * knots + np.arange(knots)]
        for sign in (1, -1):
            changes = SWINGS * STEP / paper.TORQUE_LIMIT * most if may_swing or sign < 0 else 0.0
            rows, limits = [*rows, np.pad(sign * np.diff(acts, axis=0), ((0, 0), (0, 1)))], [*limits, np.full(knots - 1, changes)]
            for line, counted, _, drop, response, _ in found:
                effect, left = sign * response[:, driver] @ acts, -sign * drop[:, driver]
                rows += [np.pad(effect, ((0, 0), (0, 1)), constant_values=-counted[driver]), np.pad(effect, ((0, 0), (0, 1)))]
                limits += [left, none_worse_than * line[driver] + left]
    bounds = ([(1, 1)] + [(-most * may_swing, most if may_swing else 1)] * (knots - 2) + [(0, 0)]) * drivers
    bounds += [(max((own[2] / own[1]).max() for own in found), None)]  # what stays below the usual peak counts as much
    best = linprog([0] * (drivers * knots) + [1], np.vstack(rows), np.concatenate(limits), bounds=bounds)
    return round(best.fun, 3) if best.success else None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    numbers = ("speed", 20, 150, 40, "km/h"), ("radius", 50, 2000, 200, "m"), ("instant", -2, 20, 3, "s into the arc")
    for name, low, high, default, told in (*numbers, ("lasts", 0.5, 6, 4, "s until the torque has ended")):
        parser.add_argument(f"--{name}", type=paper.ranged(low, high), default=default, help=f"{told} ({low} to {high}; {default})")
    for name, low, high, default in (("t-p", 0.001, 1, [0.1]), ("takes-over", 0, 5, [0.5, 1.0, 1.5, 2.0])):
        parser.add_argument(f"--{name}", type=paper.ranged(low, high), nargs="+", default=default, help=f"s ({low} to {high}; {default})")
    parser.add_argument("--reliance", choices=("high", "mid"), nargs="+", default=["high"])
    o = parser.parse_args()
    o.clothoid = CLOTHOID * o.radius / (o.speed / 3.6)
    o.fails = BEFORE + o.clothoid + o.instant
    found = list(peaks_and_responses(o))
    rounded = [[(own[0] / own[1]).round(3).tolist(), own[2].round(3)] for own in found]
    print(json.dumps(vars(o) | dict(line_beside_drop=[own[0] for own in rounded], usual_m=[own[1] for own in rounded])))
    cases = [(False, None, worse) for worse in (1.0, 1.05, 1.1, 1.2)] + [(False, 0.3, 1.0), (True, None, 1.0)]
    for names in cases:
        case = dict(zip(("may_swing", "knows_after_s", "none_worse_than"), names))
        print(json.dumps(case | dict(least_beside_drop=least(o, found, **case))), flush=True)


if __name__ == "__main__":
    main()
