"""Many closed loops at once, in numba and in JAX: what the lanes of the simulator are compared with.

Responsible for: the loop of closed_loop.py as a Python user writes it for speed: `prange` over a compiled scalar
function, or `vmap` of a `scan`. Road and matrices are closed_loop.py's. Sensors are rounded to the bus's steps, the lane at
120 Hz; frames with their protection, modes and checks are left out, so both do less than the lanes. One core.

    target/venv/bin/pip install numba jax
    target/venv/bin/python bench/many.py numba --repeat 5
"""

import argparse
import json
import os
import time

os.environ["NUMBA_NUM_THREADS"] = "1"
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

import numpy as np

import closed_loop as paper

# Delays by conditions mid, high and low, as in lanes.rs: K_d and K_hg.
DRIVES = np.array([(t_p, *gains) for t_p in 0.1 + 0.05 * np.arange(8) for gains in ((3, 0.5), (2, 0), (4, 1))])
ROAD = paper.Road(paper.PAPER_COURSE)
A, B = paper.discretise()
POINTS = np.column_stack((ROAD.xy, np.cos(ROAD.theta), np.sin(ROAD.theta), ROAD.theta, ROAD.kappa, ROAD.slope))
# Ahead of the body, m: the driver's far and near point, the body itself, the guidance's near and far point.
AHEAD = paper.V * np.array([paper.T_F, paper.T_N, 0.0, paper.GUIDE_T_N, paper.GUIDE_T_F])
BODY_EVERY = 5  # ticks between samples of the body, 200 Hz as the simulator has it
WINDOW = (1080.0, 1740.0)
STEPS = int((ROAD.length - AHEAD[0]) / (paper.V * paper.TICK)) - 50  # no far point leaves the road before


def with_numba():
    import math

    from numba import njit, prange

    points_of, step, last = POINTS, ROAD.STEP, len(POINTS) - 1
    v, tick, ahead, steps, a, b = paper.V, paper.TICK, AHEAD, STEPS, A, B
    a1, a2, a3, k_nms = paper.A1, paper.A2, paper.A3, paper.K_NMS
    gains, limit = paper.LAW_GAINS, paper.TORQUE_LIMIT
    lsb_e, lsb_h, lsb_t = paper.E_Y_LSB, paper.E_THETA_LSB, paper.T_H_LSB
    corner, rate = 2 * math.pi * paper.RATE_CORNER, paper.LANE_RATE

    @njit
    def project(x, y, s):
        offset = heading = 0.0
        for _ in range(2):
            i = min(max(int(s / step), 0), last)
            p = points_of[i]
            d = s - i * step
            k = p[5] + p[6] * d
            h = d * (p[5] + 0.5 * p[6] * d)
            u = p[2] * (x - p[0]) + p[3] * (y - p[1]) - d
            w = p[2] * (y - p[1]) - p[3] * (x - p[0]) - 0.5 * p[5] * d * d
            move = (u + w * h) / (1 - k * (w - u * h))
            s, offset, heading = s + move, w - u * h, p[4] + h + k * move
        return s, offset, heading

    @njit
    def drive(t_p, k_d, k_hg):
        x, n, line = np.zeros(6), np.zeros(6), np.zeros(1024)
        px = py = integral = e_y = asked = torque = next_lane = last_time = 0.0
        c, s, peak = 1.0, 0.0, 0.0
        at = ahead.copy()
        law = np.zeros(4)
        whole = int(t_p / tick + 1e-9)
        part = max(t_p / tick - whole, 0.0)
        for k in range(steps):
            chi, now = x[5] + x[0], k * tick
            at[0], _, far_heading = project(px + ahead[0] * c, py + ahead[0] * s, at[0] + v * tick)
            at[1], near, _ = project(px + ahead[1] * c, py + ahead[1] * s, at[1] + v * tick)
            if k % BODY_EVERY == 0:
                at[2], offset, _ = project(px, py, at[2] + BODY_EVERY * v * tick)
                if WINDOW[0] <= at[2] <= WINDOW[1]:
                    peak = max(peak, abs(offset))
            if k > 0:
                integral += 0.5 * tick * (e_y - near)
            e_y = -near
            line[k % 1024] = a1 * e_y + a2 * integral + a3 * (far_heading - chi)
            before, then = asked, k + 1 - whole
            asked = (1 - part) * line[then % 1024] + part * line[(then - 1) % 1024]
            if now >= next_lane:
                next_lane += 1 / rate
                moved = v * (now - last_time)
                at[3], offset, _ = project(px + ahead[3] * c, py + ahead[3] * s, at[3] + moved)
                at[4], _, heading = project(px + ahead[4] * c, py + ahead[4] * s, at[4] + moved)
                new_y, new_h = round(-offset / lsb_e) * lsb_e, round((heading - chi) / lsb_h) * lsb_h
                if k > 0:
                    dt = now - last_time
                    gain = corner * dt / (1 + corner * dt)
                    law[1] += gain * ((new_y - law[0]) / dt - law[1])
                    law[3] += gain * ((new_h - law[2]) / dt - law[3])
                law[0], law[2], last_time = new_y, new_h, now
                torque = 0.0
                for i in range(4):
                    torque += gains[i] * law[i]
                torque = round(min(max(torque, -limit), limit) / lsb_t) * lsb_t
            u0, u1 = (k_d + k_nms) * before - k_hg * torque, (k_d + k_nms) * asked - k_hg * torque
            for i in range(6):
                n[i] = b[i, 0] * u0 + b[i, 1] * u1 + b[i, 2] * torque
                for j in range(6):
                    n[i] += a[i, j] * x[j]
            x, n = n, x
            chi = x[5] + x[0]
            c1, s1 = math.cos(chi), math.sin(chi)
            px, py = px + 0.5 * tick * v * (c + c1), py + 0.5 * tick * v * (s + s1)
            c, s = c1, s1
        return peak

    @njit(parallel=True)
    def all_of(drives):
        peaks = np.zeros(len(drives))
        for i in prange(len(drives)):
            peaks[i] = drive(drives[i, 0], drives[i, 1], drives[i, 2])
        return peaks

    return all_of


def with_jax():
    import jax
    import jax.numpy as jnp
    from jax import lax

    jax.config.update("jax_enable_x64", True)
    points_of, ahead, a, b = (jnp.asarray(array) for array in (POINTS, AHEAD, A, B))
    v, tick, step, law_gains = paper.V, paper.TICK, ROAD.STEP, jnp.asarray(paper.LAW_GAINS)
    # Which ticks take a picture, and how long after the one before: the same of every drive.
    pictures, since, last, next_lane = np.zeros(STEPS, bool), np.zeros(STEPS), 0, 0.0
    for k in range(STEPS):
        if k * tick >= next_lane:
            next_lane += 1 / paper.LANE_RATE
            pictures[k], since[k], last = True, (k - last) * tick, k
    law_gain = 2 * np.pi * paper.RATE_CORNER * since
    ticks = (jnp.arange(STEPS), jnp.asarray(pictures), jnp.asarray(since), jnp.asarray(law_gain / (1 + law_gain)))

    def project(x, y, s):
        for _ in range(2):
            i = jnp.clip((s / step).astype(int), 0, len(POINTS) - 1)
            px, py, c, sin, theta, kappa, slope = points_of[i]
            d = s - i * step
            k, h = kappa + slope * d, d * (kappa + 0.5 * slope * d)
            u = c * (x - px) + sin * (y - py) - d
            w = c * (y - py) - sin * (x - px) - 0.5 * kappa * d * d
            move = (u + w * h) / (1 - k * (w - u * h))
            s, offset, heading = s + move, w - u * h, theta + h + k * move
        return s, offset, heading

    def drive(t_p, k_d, k_hg):
        whole = (t_p / tick + 1e-9).astype(int)
        part = jnp.maximum(t_p / tick - whole, 0.0)

        def tick_of(state, now):
            x, (px, py, c, s), at, line, integral, e_y, asked, law, torque, peak = state
            k, picture, since, gain = now
            chi = x[5] + x[0]
            far, _, far_heading = project(px + ahead[0] * c, py + ahead[0] * s, at[0] + v * tick)
            near, near_offset, _ = project(px + ahead[1] * c, py + ahead[1] * s, at[1] + v * tick)

            def look(state):
                at, peak = state
                at, offset, _ = project(px, py, at + BODY_EVERY * v * tick)
                seen = (WINDOW[0] <= at) & (at <= WINDOW[1])
                return at, jnp.where(seen, jnp.maximum(peak, jnp.abs(offset)), peak)

            body, peak = lax.cond(k % BODY_EVERY == 0, look, lambda state: state, (at[2], peak))
            integral = jnp.where(k > 0, integral + 0.5 * tick * (e_y - near_offset), 0.0)
            e_y = -near_offset
            line = line.at[k % 1024].set(paper.A1 * e_y + paper.A2 * integral + paper.A3 * (far_heading - chi))
            before, then = asked, k + 1 - whole
            asked = (1 - part) * line[then % 1024] + part * line[(then - 1) % 1024]

            def take(state):
                guide_near, guide_far, law, _ = state
                near, offset, _ = project(px + ahead[3] * c, py + ahead[3] * s, guide_near + v * since)
                far, _, heading = project(px + ahead[4] * c, py + ahead[4] * s, guide_far + v * since)
                new_y = jnp.round(-offset / paper.E_Y_LSB) * paper.E_Y_LSB
                new_h = jnp.round((heading - chi) / paper.E_THETA_LSB) * paper.E_THETA_LSB
                new = jnp.stack((new_y, new_h))
                rates = law[1::2] + gain * ((new - law[0::2]) / jnp.maximum(since, tick) - law[1::2])
                rates = jnp.where(k > 0, rates, 0.0)
                law = jnp.stack((new[0], rates[0], new[1], rates[1]))
                wanted = jnp.clip(law_gains @ law, -paper.TORQUE_LIMIT, paper.TORQUE_LIMIT)
                return near, far, law, jnp.round(wanted / paper.T_H_LSB) * paper.T_H_LSB

            guide_near, guide_far, law, torque = lax.cond(
                picture, take, lambda state: state, (at[3], at[4], law, torque)
            )
            u0, u1 = (k_d + paper.K_NMS) * before - k_hg * torque, (k_d + paper.K_NMS) * asked - k_hg * torque
            x = a @ x + b @ jnp.stack((u0, u1, torque))
            chi = x[5] + x[0]
            c1, s1 = jnp.cos(chi), jnp.sin(chi)
            place = (px + 0.5 * tick * v * (c + c1), py + 0.5 * tick * v * (s + s1), c1, s1)
            at = jnp.stack((far, near, body, guide_near, guide_far))
            return (x, place, at, line, integral, e_y, asked, law, torque, peak), None

        zero = jnp.zeros(())
        place = (zero, zero, zero + 1, zero)
        start = (jnp.zeros(6), place, ahead, jnp.zeros(1024), zero, zero, zero, jnp.zeros(4), zero, zero)
        return lax.scan(tick_of, start, ticks)[0][-1]

    compiled = jax.jit(jax.vmap(drive))
    return lambda drives: np.asarray(compiled(*drives.T))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("library", choices=("numba", "jax"))
    parser.add_argument("--repeat", type=int, default=1, help="the fastest of so many rounds is timed")
    parser.add_argument("--copies", type=int, default=1, help="each of the 24 drives so many times at once")
    options = parser.parse_args()
    run = {"numba": with_numba, "jax": with_jax}[options.library]()
    drives = np.tile(DRIVES, (options.copies, 1))
    peaks = run(drives)  # compiles
    spent = np.inf
    for _ in range(options.repeat):
        start = time.process_time()
        peaks = run(drives)
        spent = min(spent, time.process_time() - start)
    simulated = len(drives) * STEPS * paper.TICK
    print(json.dumps(dict(
        program=options.library, sensors="paper", drives=len(drives), simulated_seconds=simulated,
        processor_seconds=spent, times_real_time=simulated / spent, peak_lateral_error_m=float(peaks[0]),
    )))


if __name__ == "__main__":
    main()
