"""One closed loop of driver, guidance, bus, column, vehicle and road, in NumPy and SciPy.

Responsible for: being what a researcher would write, to show what a plain step loop in Python costs. Written from
the equations of the paper (DOI 10.1049/itr2.12163; numbers in brackets are the paper's), like its C twin
closed_loop.c, and sharing no code with the Rust crates. Terms and options are the C program's.

Not here: vectorising over runs, numba, traces. One run, one loop, 1 ms a tick.

    python3 -m venv target/venv && target/venv/bin/pip install numpy scipy
    target/venv/bin/python bench/closed_loop.py --duration 10
"""

import argparse
import json
import math
import struct
import time

import numpy as np
from scipy.linalg import expm

TICK = 1e-3  # s
V = 60 / 3.6  # m/s
TORQUE_LIMIT = 5.0  # N.m
LANE_RATE = 120.0  # Hz
BODY_EVERY = 5  # ticks between looks at the body with the paper's sensors: 200 Hz
RATE_CORNER = 10.0  # Hz, low-pass on the differenced 120 Hz samples; our choice
RESPONSE_TIME = 1.0  # s from a failure until the driver has the manual gains
MANUAL_K_D = 4.0
DIVERGED_BEYOND = 50.0  # m

# Tables 8 and 9.
A1, A2, A3, T_N, T_F, T_NMS, K_NMS = 0.1, 0.05, 3.7, 0.3, 1.0, 0.1, 1.0
LAW_GAINS = 0.25 * np.array([2.0, 0.05, 40.0, 1.0])  # K_1 * (e_y', its rate, e_theta', its rate)
GUIDE_T_N, GUIDE_T_F = 0.3, 0.7
M, I, L_F, L_R, K_F, K_R = 1100.0, 2940.0, 1.0, 1.635, 53300.0, 117000.0
K_S, E_T, B_S, J_S, K_T = 48510.0, 0.026, 0.57, 0.11, 1 / 17

# Length and curvature at start and end of each segment of the paper-course.
PAPER_COURSE = [
    (1080, 0, 0),
    (80, 0, 1 / 300), (300, 1 / 300, 1 / 300), (80, 1 / 300, 0), (200, 0, 0),
    (80, 0, -1 / 400), (250, -1 / 400, -1 / 400), (80, -1 / 400, 0), (200, 0, 0),
    (100, 0, 1 / 600), (400, 1 / 600, 1 / 600), (100, 1 / 600, 0), (400, 0, 0),
]


class Road:
    """The centreline as points 0.1 m apart and a parabola from each to the next, right to about 10 nm."""

    STEP = 0.1

    def __init__(self, segments):
        ends = np.cumsum([0.0] + [length for length, _, _ in segments])
        self.length = ends[-1]
        self.s = np.arange(0.0, self.length, self.STEP)
        which = np.searchsorted(ends, self.s + 1e-6, side="right") - 1  # a point on a joint begins a segment
        length, k0, k1 = (np.array(column, dtype=float)[which] for column in zip(*segments))
        along = (self.s - ends[which]) / length
        self.kappa = k0 + (k1 - k0) * along
        self.slope = (k1 - k0) / length
        # Heading is a parabola of the arc length; Simpson's rule takes its tangent to positions.
        turn = self.STEP * (self.kappa + 0.5 * self.STEP * self.slope)
        self.theta = np.concatenate(([0.0], np.cumsum(turn)[:-1]))
        half = self.theta + 0.5 * self.STEP * (self.kappa + 0.25 * self.STEP * self.slope)
        full = self.theta + turn
        tangents = [np.column_stack((np.cos(a), np.sin(a))) for a in (self.theta, half, full)]
        moves = self.STEP / 6 * (tangents[0] + 4 * tangents[1] + tangents[2])
        self.xy = np.vstack(([0.0, 0.0], np.cumsum(moves, axis=0)[:-1]))

    def foot(self, point, s):
        """Nearest centreline point from the guess `s`: its arc length, the offset (left positive), the heading."""
        for _ in range(5):
            i = min(max(int(s / self.STEP), 0), len(self.s) - 1)
            d = s - self.s[i]
            kappa = self.kappa[i] + self.slope[i] * d
            theta = self.theta[i] + d * (self.kappa[i] + 0.5 * self.slope[i] * d)
            tangent = np.array([math.cos(theta), math.sin(theta)])
            normal = np.array([-tangent[1], tangent[0]])
            chord = self.theta[i] + 0.5 * self.kappa[i] * d
            here = self.xy[i] + d * np.array([math.cos(chord), math.sin(chord)])
            gap = point - here
            step = (gap @ tangent) / (1 - kappa * (gap @ normal))
            s += step
            if abs(step) < 1e-6:
                break
        return s, gap @ normal, theta + kappa * step


def discretise():
    """State [beta, r, phi, phi', T_d, psi]; inputs [asked at the tick's start, at its end, T_h held] -> A, B."""
    k_aln = 2 * E_T * K_F * K_T / (1 + 2 * E_T * K_F / K_S)
    moment = L_F * K_F - L_R * K_R
    a = np.array([
        [-2 * (K_F + K_R) / (M * V), -1 - 2 * moment / (M * V**2), 2 * K_F * K_T / (M * V), 0, 0, 0],
        [-2 * moment / I, -2 * (L_F**2 * K_F + L_R**2 * K_R) / (I * V), 2 * L_F * K_F * K_T / I, 0, 0, 0],
        [0, 0, 0, 1, 0, 0],
        [k_aln / J_S, k_aln * L_F / V / J_S, -k_aln * K_T / J_S, -B_S / J_S, 1 / J_S, 0],
        [0, 0, -K_NMS / T_NMS, 0, -1 / T_NMS, 0],
        [0, 1, 0, 0, 0, 0],
    ])
    asked = np.array([0, 0, 0, 0, 1 / T_NMS, 0])
    guidance = np.array([0, 0, 0, 1 / J_S, 0, 0])
    # First-order hold on the driver's target, zero-order hold on the guidance torque, by the augmented matrix.
    augmented = np.zeros((9, 9))
    augmented[:6, :6], augmented[:6, 6], augmented[:6, 8] = a, asked, guidance
    augmented[6, 7] = 1 / TICK
    e = expm(augmented * TICK)
    return e[:6, :6], np.column_stack((e[:6, 6] - e[:6, 7], e[:6, 7], e[:6, 8]))


def crc_table():
    table = []
    for r in range(256):
        for _ in range(8):
            r = ((r << 1) ^ 0x2F) & 0xFF if r & 0x80 else r << 1
        table.append(r)
    return table


CRC_TABLE = crc_table()
DATA_IDS = bytes.fromhex("D9ADC10B75F8E07C7AE6AE929B3EEA5E")
E_Y_LSB, E_THETA_LSB, T_D_LSB, PHI_LSB, T_H_LSB = 1 / 8192, 1 / 65536, 0.005, math.radians(0.1), 0.001


class Link:
    """Eight-byte frames of one message: byte 0 CRC, low nibble of byte 1 counter (AUTOSAR E2E profile 2)."""

    def __init__(self, message):
        self.ids = bytes(b ^ message for b in DATA_IDS)
        self.sent = self.seen = 15
        self.frames = self.rejected = 0

    def crc(self, frame):
        r = 0xFF
        for b in frame[1:]:
            r = CRC_TABLE[r ^ b]
        return CRC_TABLE[r ^ self.ids[frame[1] & 15]] ^ 0xFF

    def pack(self, a, b):
        self.sent = (self.sent + 1) & 15
        self.frames += 1
        a, b = (min(max(round(x), -32768), 32767) for x in (a, b))
        frame = bytearray(struct.pack("<BBhhH", 0, 0x10 | self.sent, a, b, 0))
        frame[0] = self.crc(frame)
        return bytes(frame)

    def unpack(self, frame):
        """The two signals, or None for a frame that is damaged or repeated."""
        counter = frame[1] & 15
        if frame[0] != self.crc(frame) or counter == self.seen:
            self.rejected += 1
            return None
        self.seen = counter
        return struct.unpack_from("<hh", frame, 2)


class Law:
    """Guidance (9); `corner` in Hz filters the rates, None leaves them plain backward differences."""

    def __init__(self, corner):
        self.corner = corner
        self.time = None
        self.errors = np.zeros(2)
        self.rates = np.zeros(2)

    def sample(self, now, errors):
        if self.time is not None:
            dt = now - self.time
            wdt = 2 * math.pi * (self.corner or 0) * dt
            gain = wdt / (1 + wdt) if self.corner else 1.0
            self.rates = self.rates + gain * ((errors - self.errors) / dt - self.rates)
        self.errors, self.time = errors, now

    def torque(self):
        terms = np.array([self.errors[0], self.rates[0], self.errors[1], self.rates[1]])
        return float(np.clip(LAW_GAINS @ terms, -TORQUE_LIMIT, TORQUE_LIMIT))


def wrapped(angle):
    return math.pi - (math.pi - angle) % (2 * math.pi)


def run(options, road, a, b):
    x, xy, chi = np.zeros(6), np.zeros(2), 0.0
    direction = np.array([1.0, 0.0])
    k_d, k_hg = options.k_d, options.k_hg
    integral = e_y_before = phi_target = torque = next_lane = 0.0
    s = dict(body=0.0, near=V * T_N, far=V * T_F, guide_near=V * GUIDE_T_N, guide_far=V * GUIDE_T_F)
    delay = options.t_p / TICK
    whole, part = int(delay + 1e-9), max(delay - int(delay + 1e-9), 0.0)
    line = np.zeros(1024)
    lane, column, command = Link(0x11), Link(0x22), Link(0x5A)
    law = Law(RATE_CORNER if options.sensors == "paper" else None)
    offsets, torques, driver_torques, column_sum = [], [], [], 0.0
    diverged = False
    end = math.inf if options.duration is None else round(options.duration / TICK)
    fails = math.inf if options.failure_time is None else round(options.failure_time / TICK)

    k = 0
    while k < end:
        now = k * TICK
        s["far"], _, far_heading = road.foot(xy + V * T_F * direction, s["far"] + V * TICK)
        if s["far"] >= road.length:
            break
        s["near"], near_offset, _ = road.foot(xy + V * T_N * direction, s["near"] + V * TICK)
        sees_body = options.sensors == "exact" or k % BODY_EVERY == 0
        if sees_body:
            s["body"], offset, _ = road.foot(xy, s["body"] + V * TICK)
        if not abs(offset) < DIVERGED_BEYOND:
            diverged = True
            break
        if k == fails + round(RESPONSE_TIME / TICK):
            k_d, k_hg = MANUAL_K_D, 0.0

        # driver, visual (7): phi_target(t) = w(t - t_p), linear between ticks
        e_y = -near_offset
        if k > 0:
            integral += 0.5 * TICK * (e_y_before + e_y)
        e_y_before = e_y
        line[k % 1024] = A1 * e_y + A2 * integral + A3 * wrapped(far_heading - chi)
        before = phi_target
        then = k + 1 - whole
        phi_target = (1 - part) * line[then % 1024] + part * line[(then - 1) % 1024]

        t_h = 0.0
        if options.guidance == "on":
            picture = options.sensors == "exact" or now >= next_lane
            if picture:
                next_lane += 1 / LANE_RATE
                s["guide_near"], near_offset, _ = road.foot(xy + V * GUIDE_T_N * direction, s["guide_near"] + V * TICK)
                s["guide_far"], _, heading = road.foot(xy + V * GUIDE_T_F * direction, s["guide_far"] + V * TICK)
                errors = np.array([-near_offset, wrapped(heading - chi)])
            if options.sensors == "exact":
                law.sample(now, errors)
                torque = law.torque()
            else:
                if picture:
                    got = lane.unpack(lane.pack(errors[0] / E_Y_LSB, errors[1] / E_THETA_LSB))
                    if got:
                        law.sample(now, np.array([got[0] * E_Y_LSB, got[1] * E_THETA_LSB]))
                got = column.unpack(column.pack(x[4] / T_D_LSB, x[2] / PHI_LSB))
                if got:
                    column_sum += got[0] * T_D_LSB + got[1] * PHI_LSB
                got = command.unpack(command.pack(law.torque() / T_H_LSB, 0))
                if got:
                    torque = got[0] * T_H_LSB
            if k < fails:
                t_h = torque

        if sees_body and options.window[0] <= s["body"] <= options.window[1]:
            offsets.append(abs(offset))
            torques.append(abs(t_h))
            driver_torques.append(abs(x[4]))

        asked = np.array([before, phi_target]) * (k_d + K_NMS) - k_hg * t_h
        x = a @ x + b @ np.array([asked[0], asked[1], t_h])
        chi = x[5] + x[0]
        ahead = np.array([math.cos(chi), math.sin(chi)])
        xy = xy + 0.5 * TICK * V * (direction + ahead)
        direction = ahead
        k += 1

    links = (lane, column, command)
    return dict(
        simulated_seconds=k * TICK,
        peak_lateral_error_m=max(offsets, default=None),
        mean_abs_lateral_error_m=float(np.mean(offsets)) if offsets else None,
        peak_guidance_torque_nm=max(torques, default=None),
        peak_driver_torque_nm=max(driver_torques, default=None),
        column_sum=column_sum,
        steps=k,
        frames=sum(link.frames for link in links),
        frames_rejected=sum(link.rejected for link in links),
        diverged=diverged,
    )


def ranged(low, high):
    def parse(text):
        value = float(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} is not from {low} to {high}")
        return value

    return parse


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--t-p", type=ranged(TICK, 1.0), default=0.3, help="driver's delay, s")
    parser.add_argument("--k-d", type=ranged(0, 100), default=2.0, help="target angle to torque, N.m/rad")
    parser.add_argument("--k-hg", type=ranged(0, 1), default=0.0, help="reaction to guidance")
    parser.add_argument("--guidance", choices=("on", "off"), default="on")
    parser.add_argument("--failure-time", type=ranged(0, 1e4), help="guidance torque drops to 0 here, s")
    parser.add_argument("--sensors", choices=("exact", "paper"), default="paper")
    parser.add_argument("--window", nargs=2, type=ranged(0, 1e5), default=(1080, 1740), metavar=("FROM", "TO"))
    parser.add_argument("--duration", type=ranged(TICK, 1e4), help="stop early, s (default: the whole course)")
    options = parser.parse_args()

    road = Road(PAPER_COURSE)
    a, b = discretise()
    start = time.thread_time()
    result = run(options, road, a, b)
    spent = time.thread_time() - start
    inputs = dict(
        program="numpy", sensors=options.sensors, guidance=options.guidance == "on", t_p=options.t_p,
        k_d=options.k_d, k_hg=options.k_hg, failure_time_s=options.failure_time,
    )
    result |= dict(processor_seconds=spent, times_real_time=result["simulated_seconds"] / spent)
    print(json.dumps(inputs | result, default=float))


if __name__ == "__main__":
    main()
