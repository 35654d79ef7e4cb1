"""The controller's FMUs on a recorded bus: agree.py DIRECTORY < BUS, with lines of "t_us id data".

The unit makes its frames itself, of SI values. It is given those that the recorded frames carry, each at its millisecond; torque,
limit and mode have to be those of the recorded guidance frames, bit for bit. Prints for each standard how many frames were
compared and how many differ.
"""

import itertools
import math
import sys
from pathlib import Path

import cantools

from check import Unit

INPUTS = {
    "LanePreview_LateralError": "e_y_m",
    "LanePreview_YawError": "e_theta_rad",
    "Column_DriverTorque": "driver_torque_nm",
    "Column_WheelAngle": "wheel_angle_rad",
    "Column_MotorTorque": "motor_torque_nm",
    "Vehicle_Speed1": "speed_m_per_s",
    "Vehicle_YawRate": "yaw_rate_rad_per_s",
    "Request_Authority": "authority",
}
# The DBC file has the wheel angle in degrees.
FACTORS = {"Column_WheelAngle": math.pi / 180}
FLAGS = {"Request_Engage": "engage", "Request_Probe": "probe", "Vehicle_YawRateValid": "yaw_rate_valid"}


def main(directory):
    database = cantools.database.load_file("core/haptic.dbc")
    lines = [line.split() for line in sys.stdin]
    for ending in ("fmu", "fmi3.fmu"):
        unit = Unit(directory / f"HapticController.{ending}", engaged_at_start=True)
        frames = differing = 0
        for step, (_, bus) in enumerate(itertools.groupby(lines, key=lambda line: int(line[0]))):
            said = {}
            for _, identifier, data in bus:
                message = database.get_message_by_frame_id(int(identifier, 16))
                said.update(message.decode(bytes.fromhex(data), decode_choices=False, allow_truncated=True))
            values = {
                name: FACTORS.get(signal, 1.0) * said[signal] for signal, name in INPUTS.items() if signal in said
            }
            flags = {name: bool(said[signal]) for signal, name in FLAGS.items() if signal in said}
            if values:
                unit.put(**values)
            if flags:
                unit.turn(**flags)
            unit.step(step)
            got = (unit.get("torque_nm")[0], unit.code("limit"), unit.code("mode"))
            frames += 1
            differing += got != (said["Guidance_Torque"], said["Guidance_Limit"], said["Guidance_Mode"])
        unit.end()
        print(frames, differing)


main(Path(sys.argv[1]))
