"""How many steps of the ECU a second of Python can drive, beside the closed loop that never leaves Rust; and what one
environment of Gymnasium costs beside the simulation in it.

    cargo xtask wheel --bench
"""

import time

import gymnasium
import numpy as np

import haptic_guidance as hg
import haptic_guidance.envs  # registers the environments

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

def an_environment():
    for _ in range(STEPS // 10):
        env.step(hand)


def its_simulation():
    simulation = hg.Simulation(straight)
    for _ in range(STEPS // 10):
        simulation.step(action, 10)


print(f"closed loop in Rust, vehicle and driver included: {in_rust:,.0f} steps/s")
for name, work in (("Ecu.step", bare), ("Ecu.step with the frames of Bus", with_bus)):
    rate = STEPS / seconds(work)
    print(f"{name}: {rate:,.0f} steps/s from Python, {rate / in_rust:.2f} of the closed loop in Rust")

straight = hg.Scenario(course={"segment": [{"length_m": 20_000.0}]})
env, hand = gymnasium.make("haptic_guidance/Driver-v0", scenario=straight), np.zeros(1, dtype=np.float32)
action = hg.Action(hand_torque_nm=0.0)
env.reset(seed=1)
simulated, stepped = seconds(its_simulation), seconds(an_environment)
print(f"one environment, 10 ms a step: {STEPS / 10 / stepped:,.0f} steps/s, {simulated / stepped:.2f} of Simulation.step")
