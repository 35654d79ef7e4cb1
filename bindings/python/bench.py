"""How many steps of the ECU a second of Python can drive, beside the closed loop that never leaves Rust.

    cargo xtask wheel --bench
"""

import time

import haptic_guidance as hg

STEPS = 200_000


def seconds(work):
    """The best of three, as other work only ever slows one down."""
    best = float("inf")
    for _ in range(3):
        begun = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - begun)
    return best


def bare():
    ecu = hg.Ecu(engaged=True)
    for t_us in range(0, 1000 * STEPS, 1000):
        ecu.step(t_us).torque_nm


def with_bus():
    ecu, bus = hg.Ecu(engaged=True), hg.Bus()
    torque_nm = 0.0
    for t_us in range(0, 1000 * STEPS, 1000):
        for frame in bus.frames(
            t_us,
            e_y_m=0.0,
            e_theta_rad=0.0,
            driver_torque_nm=0.0,
            wheel_angle_rad=0.0,
            motor_torque_nm=torque_nm,
            speed_m_per_s=16.7,
        ):
            ecu.receive(frame.id, frame.data, t_us)
        torque_nm = ecu.step(t_us).torque_nm


scenario = hg.Scenario()
run = hg.simulate(scenario)
in_rust = run.steps / seconds(lambda: hg.simulate(scenario))
print(f"closed loop in Rust, vehicle and driver included: {in_rust:,.0f} steps/s")
for name, work in (("Ecu.step", bare), ("Ecu.step with the frames of Bus", with_bus)):
    rate = STEPS / seconds(work)
    print(f"{name}: {rate:,.0f} steps/s from Python, {rate / in_rust:.2f} of the closed loop in Rust")
