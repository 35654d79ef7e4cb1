"""Writes tests/data/layouts: a simulated driver of known parameters, as recordings of other people's layouts hold one.

    python tests/tools/make_layouts.py HOST_SIM      (needs numpy and scipy; HOST_SIM is the program)

The driver has K_hg = 0.3, t_p = 0.2 s and a remnant of 0.1 N.m: 100 s under guidance with a probe of 0.3 N.m at 1 Hz, then 60 s by hand.
The channel is that of the real recordings: 10 Hz, two lane lines with noise of 2 cm, torque in steps of 0.01 N.m, angle of 1/16 deg.
"""

import csv
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import scipy.io

OUT = Path(__file__).parents[1] / "data/layouts"
DRIVER = "[driver]\nt_p_s = 0.2\nremnant_sd_nm = 0.1\n"
PROBE = "[guidance]\nprobe = true\nprobe_amplitude_nm = 0.3\nprobe_frequency_hz = 1\n"


def drive(host_sim, scenario):
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        (place / "s.toml").write_text(scenario)
        subprocess.run([host_sim, "run", place / "s.toml", "--out", place / "out"], check=True, capture_output=True)
        table = np.genfromtxt(place / "out/run.csv", delimiter=",", names=True)
    return table


def rows(table, hz, seconds):
    times = 20 + np.arange(0, seconds, 1 / hz)
    return {name: np.interp(times, table["time_s"], table[name]) for name in table.dtype.names}


def write(name, *tables, heading=True):
    names, columns = zip(*(column for table in tables for column in table.items()))
    with open(OUT / name, "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        if heading:
            table.writerow(names)
        table.writerows(zip(*columns))


def openpilot_like(d, random, shared):
    n = len(d["time_s"])
    lane = random.normal(0, 0.02, (2, n))
    degrees = np.round(np.degrees(d["wheel_angle_rad"]) * 16) / 16
    return {
        "shared": [str(bool(s)) for s in shared],
        "speed": d["speed_m_per_s"].round(4),
        "acceleration": np.zeros(n),
        "guidance": (d["guidance_torque_nm"] / 3).round(5) * shared,
        "desired": (-d["curvature_1pm"]).round(7),
        "driven": (-d["yaw_rate_rad_per_s"] / d["speed_m_per_s"]).round(7),
        "torque": d["driver_torque_nm"].round(2),
        "angle": degrees,
        "left": (d["lateral_error_m"] - 1.8 + lane[0]).round(4),
        "right": (d["lateral_error_m"] + 1.8 + lane[1]).round(4),
    }


OPENLKA = {
    "shared": "op_lat_enable",
    "speed": "vEgo",
    "acceleration": "aEgo",
    "guidance": "latOutput",
    "desired": "op_curvature_desired",
    "driven": "op_curvature_actual",
    "torque": "op_state_steer_torque",
    "angle": "op_state_steer_angle",
    "left": "op_left_laneline",
    "right": "op_right_laneline",
}
OPENPILOT = {
    "shared": "/carControl/latActive",
    "speed": "/carState/vEgo",
    "acceleration": "/carState/aEgo",
    "guidance": "/carOutput/actuatorsOutput/torque",
    "desired": "/controlsState/desiredCurvature",
    "driven": "/controlsState/curvature",
    "torque": "/carState/steeringTorque",
    "angle": "/carState/steeringAngleDeg",
    "left": "/modelV2/laneLines/1/y/0",
    "right": "/modelV2/laneLines/2/y/0",
}


def main(host_sim):
    random = np.random.default_rng(26)
    guided = drive(host_sim, "seed = 5\n" + DRIVER + "K_hg = 0.3\n" + PROBE)
    manual = drive(host_sim, 'seed = 6\ncondition = "manual"\n' + DRIVER)

    both = [rows(guided, 10, 100), rows(manual, 10, 60)]
    d = {name: np.concatenate([part[name] for part in both]) for name in both[0]}
    shared = np.concatenate([np.ones(1000), np.zeros(600)])
    signals = openpilot_like(d, random, shared)
    jitter = random.uniform(-0.001, 0.001, 1600)
    time = {"Time": (100 + 0.1 * np.arange(1600) + jitter).round(4)}
    driven = signals["speed"] * signals["driven"]
    angles = {"body_yaw_angle": (0.1 * np.cumsum(driven)).round(5), "body_roll_angle": np.zeros(len(driven))}
    wrong = {"steer_torque_driver": (20_000 + random.normal(0, 300, 1600)).round(1)}
    # Behind all, the time of the segment, by the name that the time of the drive has.
    since = {"Time": (time["Time"] - time["Time"][0]).round(4)}
    write("openlka.csv", time, {OPENLKA[name]: values for name, values in signals.items()}, wrong, angles, since)

    d = rows(guided, 20, 15)
    signals = openpilot_like(d, random, np.ones(300))
    time = {"__time": (1.7e9 + 0.05 * np.arange(300)).round(3)}
    write("openpilot.csv", time | {OPENPILOT[name]: values for name, values in signals.items()})

    d = rows(manual, 20, 12)
    n = len(d["time_s"])
    write(
        "udacity.csv",
        {
            "index": [f"2016-11-17 23:10:{15 + 0.05 * k:09.6f}" for k in range(n)],
            "timestamp": [1479424215873184606 + 50_000_000 * k for k in range(n)],
            "width": [640] * n,
            "height": [480] * n,
            "frame_id": ["center_camera"] * n,
            "filename": [f"center/{k}.jpg" for k in range(n)],
            "angle": d["wheel_angle_rad"].round(6),
            "torque": (d["driver_torque_nm"] * 16).round() / 16,
            "speed": d["speed_m_per_s"].round(4),
            "lat": [37.5] * n,
            "long": [-122.3] * n,
            "alt": [8.1] * n,
        },
        heading=False,
    )
    write(
        "sadc.csv",
        {
            "index": range(n),
            "v_kmph": (3.6 * d["speed_m_per_s"]).round(3),
            "d_lanecenter_m": (-d["lateral_error_m"]).round(3),
            "steering_rack_pos_m": (d["wheel_angle_rad"] / 100).round(7),
            "steering_torque_N": (100 * d["driver_torque_nm"]).round(1),
            "lane_curvature_radpm": d["curvature_1pm"].round(7),
            "split": ["val_train"] * n,
            "frame_nr": range(5850, 5850 + n),
        },
    )
    t = 0.05 * np.arange(n)
    front = d["wheel_angle_rad"] / 16
    path = np.cumsum(d["speed_m_per_s"]) * 0.05
    scipy.io.savemat(
        OUT / "cognitive-driver-model.mat",
        {
            "CMD_HUM": np.vstack([t, np.ones(n), np.zeros(n), front]),
            "RESP_VEH": np.vstack([t, d["speed_m_per_s"], path, np.zeros(n), np.zeros(n)]),
            "DELAY": np.zeros(n, dtype=np.uint8),
        },
        do_compression=True,
    )


if __name__ == "__main__":
    main(sys.argv[1])
