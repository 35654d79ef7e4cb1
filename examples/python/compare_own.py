"""A law and a driver of one's own in a comparison, beside those that are there.

Run it from any place: ``python compare_own.py``.
"""

import tempfile
from pathlib import Path

import haptic_guidance as hg

FILE = """
name = "own"
seeds = 1
roads = ["road.toml"]
speeds_m_per_s = [16.666666666666668]
faults = { sudden_loss = 1, lasts_s = 5 }
scenario = { driver = { remnant_sd_nm = 0.1 } }
law = [{ kind = "paper" }, { kind = "spring", stiffness_nm_per_rad = 3 }]
driver = [{ kind = "paper" }, { kind = "intermittent" }]
"""
ROAD = "[[segment]]\nlength_m = 150\n[[segment]]\nlength_m = 150\ncurvature_per_m = 0.003\n"


class Spring:
    """Pulls the wheel to the angle that the lane ahead asks for."""

    parameters = {"stiffness_nm_per_rad": (2.0, 0.0, 20.0)}  # default, least, largest

    def __init__(self, stiffness_nm_per_rad: float) -> None:
        self.stiffness_nm_per_rad = stiffness_nm_per_rad

    def ask(self, view: hg.LawView) -> float:
        target_rad = 0.5 * view.e_y_m + 12.0 * view.e_theta_rad
        return self.stiffness_nm_per_rad * (target_rad - view.wheel_angle_rad)


class Intermittent:
    """Decides five times a second where to turn the wheel, and then turns it there."""

    look_ahead_s = (0.8, 1.0)
    target_rad = 0.0

    def step(self, view: hg.DriverView) -> float:
        if view.step % 200 == 0:
            self.target_rad = 0.2 * view.e_y_m + 5.5 * view.e_theta_rad
        turns_nm = 8.0 * (self.target_rad - view.wheel_angle_rad)
        return turns_nm - 0.3 * view.wheel_rate_rad_per_s - 0.5 * view.guidance_torque_nm


def compared() -> hg.Comparison:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "own.toml"
        file.with_name("road.toml").write_text(ROAD)
        file.write_text(FILE)
        return hg.compare(file, laws={"spring": Spring}, drivers={"intermittent": Intermittent})


if __name__ == "__main__":
    for drive in compared().drives:
        print(drive["law"], drive["driver"], f"{drive['peak_lateral_error_m']:.3f} m")
