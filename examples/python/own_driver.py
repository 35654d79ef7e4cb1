"""A driver of one's own, stepped from outside at 1 kHz: the one of examples/own_driver.rs.

Run it from any place: ``python own_driver.py``.
"""

import haptic_guidance as hg

LINE_M = 0.2  # left of the middle of the lane
DECIDES_EVERY = 200  # steps of 1 ms


class Intermittent:
    """Decides five times a second where to turn the wheel, and then turns it there."""

    target_rad = 0.0

    def step(self, view: hg.DriverView) -> float:
        if view.step % DECIDES_EVERY == 0:
            self.target_rad = 0.2 * (view.e_y_m + LINE_M) + 5.5 * view.e_theta_rad
        stiffness_nm_per_rad = 12.0 if view.warning else 8.0
        turns_nm = stiffness_nm_per_rad * (self.target_rad - view.wheel_angle_rad)
        # Nobody holds quite still: twice a second the grip changes, and so the ECU feels hands.
        grip_nm = 0.1 if view.step % 1000 < 500 else -0.1
        return turns_nm - 0.3 * view.wheel_rate_rad_per_s - 0.5 * view.guidance_torque_nm + grip_nm


def drive() -> list[float]:
    """The lateral errors of a drive, 200 a second."""
    scenario = hg.Scenario(driver={"t_n_s": 0.8, "t_f_s": 1.0})
    simulation = hg.Simulation(scenario, own_driver=True)
    driver, errors_m = Intermittent(), []
    while (view := simulation.view()) is not None:
        outcome = simulation.step(hg.Action(hand_torque_nm=driver.step(view)))
        if outcome is not None and outcome.sample is not None:
            errors_m.append(outcome.sample["lateral_error_m"])
    return errors_m


if __name__ == "__main__":
    print(f"largest lateral error {max(map(abs, drive())):.3f} m")
