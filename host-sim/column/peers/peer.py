"""The torsion bar once more, without a line of haptic-column: python-control for resonances and margins, SciPy for a drive.

    python3 -m venv target/python/column
    target/python/column/bin/pip install control scipy
    target/python/column/bin/python host-sim/column/peers/peer.py

It prints the constants of host-sim/column/tests/peers.rs. Equations are written here as differential equations of each body;
nothing is taken from the Rust sources but the parameters.
"""

import control
import numpy as np
from scipy.integrate import solve_ivp

# Table 9 of the paper.
M, I, L_F, L_R, K_F, K_R, K_S, E_T, B_S, J_S, K_T = (
    1100.0, 2940.0, 1.0, 1.635, 53300.0, 117000.0, 48510.0, 0.026, 0.57, 0.11, 1 / 17)
J_W, K_TB, B_TB, B_W = 0.044, 143.24, 0.0, 0.05
J_C, B_C = J_S - J_W, B_S - B_W
SENSOR_S, MOTOR_S, LEAD_S, LAG_S = 0.001, 0.001, 0.012, 0.001
K_ALN = 2 * E_T * K_F * K_T / (1 + 2 * E_T * K_F / K_S)


def open_loop(v, held):
    """From the motor's demand to what the compensator makes of the bar's torque, as a state-space system."""
    # vy, r, phi_c, w_c, sensor, lead, motor, and the wheel where hands do not hold it: phi_w, w_w.
    n = 7 if held else 9
    a, b = np.zeros((n, n)), np.zeros((n, 1))
    # Lateral forces of both axles by slip.
    a[0, 0] = -2 * (K_F + K_R) / (M * v)
    a[0, 1] = -v - 2 * (L_F * K_F - L_R * K_R) / (M * v)
    a[0, 2] = 2 * K_F * K_T / M
    a[1, 0] = -2 * (L_F * K_F - L_R * K_R) / (I * v)
    a[1, 1] = -2 * (L_F**2 * K_F + L_R**2 * K_R) / (I * v)
    a[1, 2] = 2 * L_F * K_F * K_T / I
    a[2, 3] = 1
    # Aligning torque, bar, damping, motor on the column.
    a[3, 0], a[3, 1], a[3, 2] = K_ALN / v / J_C, K_ALN * L_F / v / J_C, -(K_ALN * K_T + K_TB) / J_C
    a[3, 3], a[3, 6] = -(B_C + B_TB) / J_C, 1 / J_C
    a[4, 2], a[4, 4] = -K_TB / SENSOR_S, -1 / SENSOR_S
    a[5, 4], a[5, 5] = 1 / LAG_S, -1 / LAG_S
    a[6, 6], b[6, 0] = -1 / MOTOR_S, 1 / MOTOR_S
    if not held:
        a[3, 7], a[3, 8] = K_TB / J_C, B_TB / J_C
        a[4, 7] = K_TB / SENSOR_S
        a[7, 8] = 1
        a[8, 2], a[8, 3] = K_TB / J_W, B_TB / J_W
        a[8, 7], a[8, 8] = -K_TB / J_W, -(B_TB + B_W) / J_W
    c = np.zeros((1, n))
    c[0, 4], c[0, 5] = LEAD_S / LAG_S, 1 - LEAD_S / LAG_S
    return control.ss(a, b, c, 0)


def margins(slope, v_kmh, held):
    """Gain margin, phase margin (deg), its frequency (Hz), and the largest sensitivity of the assist's loop."""
    # The loop is opened at the motor, so that its gain is that of a negative feedback.
    loop = -slope * open_loop(v_kmh / 3.6, held)
    w = np.logspace(-1, 4, 4_001)
    response = control.frd(loop, w, smooth=True)
    gm, pm, sm, _, w_gain, _ = control.stability_margins(response)
    stable = np.max(np.linalg.eigvals(control.feedback(loop, 1).A).real) < 0
    return gm, pm, w_gain / (2 * np.pi), 1 / sm, stable


def drive():
    """The bar with friction and an assist of points, under torques of sines; the states after 2 s at 60 km/h."""
    v, give, upper, lower = 60 / 3.6, np.radians(0.2), 0.2, 0.5
    torque = [0, 0.5, 1, 2, 3, 4, 8]
    assist = [0, 0.25, 1, 3.5, 7, 11, 27]

    def rates(t, x):
        vy, r, pw, ww, zw, pc, wc, zc, s, c, m = x
        hands, guidance = 3 * np.sin(2 * np.pi * 0.7 * t), 0.8 * np.sin(2 * np.pi * 1.9 * t)
        bar = K_TB * (pw - pc) + B_TB * (ww - wc)
        u = LEAD_S / LAG_S * s + (1 - LEAD_S / LAG_S) * c
        demand = np.sign(u) * np.interp(abs(u), torque, assist) + guidance
        front = 2 * K_F * (K_T * pc - (vy + L_F * r) / v)
        rear = 2 * K_R * -(vy - L_R * r) / v
        aligning = -K_ALN * (K_T * pc - (vy + L_F * r) / v)
        return [(front + rear) / M - v * r, (L_F * front - L_R * rear) / I,
                ww, (hands - bar - B_W * ww - upper * zw / give) / J_W, ww - abs(ww) * zw / give,
                wc, (bar + m + aligning - B_C * wc - lower * zc / give) / J_C, wc - abs(wc) * zc / give,
                (K_TB * (pw - pc) - s) / SENSOR_S, (s - c) / LAG_S, (demand - m) / MOTOR_S]

    # Pieces of a millisecond, with the torques of each held as the simulator holds them.
    x = np.zeros(11)
    for k in range(2000):
        held = k / 1000
        x = solve_ivp(lambda _, x: rates(held, x), [0, 1e-3], x, rtol=1e-11, atol=1e-13, method="DOP853").y[:, -1]
    return x


if __name__ == "__main__":
    column_held = np.roots([J_W, B_W + B_TB, K_TB])
    print(f"wheel on its bar, column held: {abs(column_held[0]) / 2 / np.pi:.6f} Hz")
    for slope, v_kmh in [(2, 60), (4, 60), (5, 60), (8, 30), (20, 5)]:
        for held in [False, True]:
            print(slope, v_kmh, "held" if held else "free", *(f"{x:.6f}" for x in margins(slope, v_kmh, held)))
    print("drive:", ", ".join(f"{x:.9e}" for x in drive()))
