"""Recordings held against the tools that others read and write them with: pandas and pyarrow, scipy.io, asammdf,
python-can with cantools, mcap. What `host-sim convert` writes they read, and what they write it reads: the same values,
units and time stamps.

    check.py HOST_SIM DIRECTORY CSV BUS_LOG DRIVER_LOG

CSV and BUS_LOG are of one run of `host-sim run --bus-log`, DRIVER_LOG is a recorded drive.
"""

import json
import subprocess
import sys
import warnings
from pathlib import Path

import asammdf
import can
import cantools
import numpy as np
import pandas
import pyarrow.parquet
import scipy.io
from mcap.reader import make_reader

HOST_SIM, WORK, CSV, BUS, DRIVE = sys.argv[1], *map(Path, sys.argv[2:])
# pandas 4 reads exactly without being told to, and says so.
warnings.filterwarnings("ignore", message=".*float_precision.*")
DBC = "core/haptic.dbc"
# Parts of a microsecond: what a file's clock, or a double that counts from 1970, can tell.
CLOCK = 1e-6


def host_sim(*arguments, code=0):
    done = subprocess.run([HOST_SIM, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == code, (arguments, done.returncode, done.stderr)
    return done.stdout if code == 0 else done.stderr


def convert(source, target, *options):
    host_sim("convert", "--force", source, WORK / target, *options)
    return WORK / target


def table(path):
    return pandas.read_csv(path, float_precision="round_trip")


def same(ours, theirs, what):
    ours, theirs = np.asarray(ours, float), np.asarray(theirs, float)
    assert ours.shape == theirs.shape, (what, ours.shape, theirs.shape)
    assert np.array_equal(ours, theirs, equal_nan=True), (what, np.nanmax(np.abs(ours - theirs)))


def units(path):
    return {channel["name"]: channel["unit"] for channel in json.loads(host_sim("convert", path, "--json"))["channels"]}


def written_by_us(run):
    """What others read in our files."""
    unit = units(CSV)
    names = [name for name in run.columns if name != "time_s"]
    assert unit["guidance_torque_nm"] == "N.m" and unit["curvature_1pm"] == "1/m" and len(unit) == len(names)

    path = convert(CSV, "run.parquet")
    frame = pandas.read_parquet(path)
    assert list(frame.columns) == list(run.columns)
    said = json.loads(pyarrow.parquet.read_schema(path).metadata[b"haptic.channels"])
    assert {c["name"]: c["unit"] for c in said if c["name"] != "time_s"} == unit
    mat = scipy.io.loadmat(convert(CSV, "run.mat"), simplify_cells=True)
    mdf = asammdf.MDF(convert(CSV, "run.mf4"))
    for name in run.columns:
        same(frame[name], run[name], f"Parquet {name}")
        same(mat[name], run[name], f"MAT {name}")
        if name != "time_s":
            signal = mdf.get(name)
            same(signal.samples, run[name], f"MDF {name}")
            same(signal.timestamps, run["time_s"], f"MDF time of {name}")
            assert signal.unit == mat["units"][name] == unit[name], name
    for path in (WORK / "run.parquet", WORK / "run.mat", WORK / "run.mf4"):
        assert units(path) == unit, path
        back = table(convert(path, "back.csv"))
        for name in run.columns:
            same(back[name], run[name], f"{path} back: {name}")

    found = {}
    with open(convert(CSV, "run.mcap"), "rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            for name, value in json.loads(message.data).items():
                found.setdefault(name, []).append((message.log_time, value))
                assert channel.metadata[name] == unit[name]
    for name in names:
        times, values = map(np.array, zip(*found[name]))
        same(values, run[name].dropna(), f"MCAP {name}")
        assert np.abs(times * 1e-9 - run["time_s"]).max() < CLOCK


def frames(reader):
    return [(m.timestamp, m.arbitration_id, m.is_extended_id, bytes(m.data)) for m in reader]


def same_frames(ours, theirs, what):
    assert len(ours) == len(theirs) > 0, (what, len(ours), len(theirs))
    for a, b in zip(ours, theirs):
        assert a[1:] == b[1:] and abs(a[0] - b[0]) < CLOCK, (what, a, b)


def buses():
    """candump, ASC and BLF, of a run that begins at zero and of a date in this century, with an identifier of 29 bits."""
    sent = frames(can.CanutilsLogReader(BUS))
    dated = WORK / "dated.log"
    with open(dated, "w") as file:
        file.write("(1700000000.123456) can0 1ABCDEF0#0102\n")
        for time, identifier, _, data in sent[:5000]:
            file.write(f"({1700000001 + time:.6f}) can0 {identifier:03X}#{data.hex()}\n")
    for log in (BUS, dated):
        expected = frames(can.CanutilsLogReader(log))
        same_frames(frames(can.BLFReader(convert(log, "bus.blf"))), expected, "BLF")
        begin = float(np.floor(expected[0][0])) if log is dated else 0.0
        shifted = [(time - begin, *rest) for time, *rest in expected]
        same_frames(frames(can.ASCReader(convert(log, "bus.asc"))), shifted, "ASC")
        for name, kind in (("theirs.blf", can.BLFWriter), ("theirs.asc", can.ASCWriter)):
            with kind(WORK / name) as writer:
                for time, identifier, extended, data in expected:
                    writer.on_message_received(
                        can.Message(time, identifier, is_extended_id=extended, data=data, channel=0)
                    )
            back = frames(can.CanutilsLogReader(convert(WORK / name, "back.log")))
            start = expected[0][0] if name.endswith("asc") else 0.0
            same_frames(back, [(time - start, *rest) for time, *rest in expected], name)

    # What the frames mean, against cantools, in the DBC file's own units.
    database = cantools.database.load_file(DBC)
    decoded = {}
    for time, identifier, _, data in sent:
        message = database.get_message_by_frame_id(identifier)
        for name, value in message.decode(data, decode_choices=False, allow_truncated=True).items():
            decoded.setdefault(name, []).append((time, float(value)))
    ours = table(convert(BUS, "signals.csv"))
    ours.columns = [name.split(" [")[0] for name in ours.columns]
    for name, values in decoded.items():
        if name not in ours:
            continue
        column = ours[["time_s", name]].dropna()
        times, values = map(np.array, zip(*dict(values).items()))
        assert np.allclose(column["time_s"], times, atol=CLOCK) and np.allclose(column[name], values, rtol=1e-12), name
    assert {"Column_DriverTorque", "Guidance_Torque", "LanePreview_LateralError"} <= set(decoded) & set(ours)
    even = table(convert(BUS, "even.csv", "--rate", "100"))
    assert np.allclose(np.diff(even["time_s"]), 0.01)


def edges():
    """Logs of several buses and kinds of frames, and a cut one: what python-can and cantools read in them."""
    place = Path("tests/data/buses")
    for name, meaning in (
        ("two.log", "one"), ("two.asc", "one"), ("channels.blf", "one2"), ("channels.asc", "one2"),
        ("fdclassic101.blf", "one2"), ("mixed.blf", "one2"), ("cut.blf", "one2"), ("channels.mf4", "one2"),
    ):
        meaning = place / f"{meaning}.dbc"
        database = cantools.database.load_file(meaning)
        expected = {}
        for frame in can.LogReader(place / name):
            if frame.is_error_frame or frame.is_remote_frame or frame.is_extended_id:
                continue
            known = [m for m in database.messages if m.frame_id == frame.arbitration_id]
            for message in known:
                decoded = message.decode(bytes(frame.data), decode_choices=False, allow_truncated=True)
                for signal, value in decoded.items():
                    expected.setdefault((frame.channel, signal), []).append(float(value))
        ours = table(convert(place / name, "edges.csv", "--dbc", meaning)).drop(columns="time_s")
        ours = {column.split(" [")[0]: ours[column].dropna().to_numpy() for column in ours}
        ours = {column: values for column, values in ours.items() if len(values)}
        assert len(ours) == len(expected) > 0, (name, list(ours), list(expected))
        for (_, signal), values in expected.items():
            same = [v for c, v in ours.items() if c.split(".")[-1] == signal and len(v) == len(values)]
            assert any(np.allclose(v, values, rtol=1e-12) for v in same), (name, signal)


def written_by_them(run):
    """What others write, with their types, compressions and units."""
    small = run.iloc[:400]
    packed = ("snappy", "gzip", "zstd", "lz4", None)
    for compression in packed:
        small.to_parquet(WORK / f"pandas{compression}.parquet", compression=compression)
    small.astype({"e_y_m": "float32"}).to_csv(WORK / "pandas.csv", index=False)
    columns = {name: small[name].to_numpy() for name in small}
    for compressed in (False, True):
        scipy.io.savemat(WORK / f"scipy{compressed}.mat", columns, do_compression=compressed, oned_as="column")
    for name in (*(f"pandas{c}.parquet" for c in packed), "pandas.csv", "scipyFalse.mat", "scipyTrue.mat"):
        back = table(convert(WORK / name, "back.csv"))
        for column in small.columns:
            expected = small[column].astype("float32") if name == "pandas.csv" and column == "e_y_m" else small[column]
            assert np.allclose(back[column], expected, rtol=1e-7 if name == "pandas.csv" else 0, atol=0, equal_nan=True)

    mdf = asammdf.MDF(version="4.10")
    time = small["time_s"].to_numpy()
    raw = np.round(small["wheel_angle_rad"].to_numpy() * 1e4).astype(np.int16)
    signals = [
        asammdf.Signal(small["e_y_m"].to_numpy(), time, name="Offset", unit="m"),
        asammdf.Signal(
            raw, time, name="Angle", unit="deg", conversion={"a": 0.01, "b": 0.5}
        ),
        asammdf.Signal(small["s_m"].to_numpy().astype(">f4"), time, name="Station", unit="m"),
    ]
    mdf.append(signals)
    slow = time[::7]
    mdf.append([asammdf.Signal(np.arange(len(slow), dtype=np.uint8), slow, name="Count")])
    for compression in (0, 1, 2):
        path = WORK / f"asammdf{compression}.mf4"
        mdf.save(path, overwrite=True, compression=compression)
        back = table(convert(path, "back.csv"))
        named = {name.split(" [")[0]: back[name] for name in back}
        at = np.isin(back["time_s"], time)
        same(named["Offset"][at], small["e_y_m"], "asammdf Offset")
        assert np.allclose(named["Angle [deg]".split(" [")[0]][at], raw * 0.01 + 0.5, rtol=1e-12)
        same(named["Station"][at], small["s_m"].astype("float32"), "asammdf Station")
        same(named["Count"].dropna(), np.arange(len(slow)) % 256, "asammdf Count")
        assert units(path)["Angle"] == "deg"


def identified(log, *options):
    out = json.loads(host_sim("identify", log, "--json", "--out", WORK / "identify", *options))
    found = (out.get("results") or out)
    return json.dumps(found.get("parameters") or found["identification"]["parameters"])


def foreign_names():
    """A drive as a test bench might log it, identified with --map: the numbers are those of the CSV file."""
    drive = table(DRIVE)
    expected = identified(DRIVE)
    drive.to_parquet(WORK / "drive.parquet")
    assert identified(WORK / "drive.parquet") == expected
    names = {
        "e_y_m": "Lane.Offset", "e_theta_rad": "Lane.Heading", "wheel_angle_rad": "SteeringAngle",
        "guidance_torque_nm": "MotorTorque", "driver_torque_nm": "TorsionBar",
    }
    mdf = asammdf.MDF(version="4.10")
    time = drive["time_s"].to_numpy()
    unit = {"e_y_m": "m", "e_theta_rad": "rad", "wheel_angle_rad": "rad", "guidance_torque_nm": "Nm",
            "driver_torque_nm": "Nm"}
    mdf.append([
        asammdf.Signal(drive[own].to_numpy(), time, name=name, unit=unit[own]) for own, name in names.items()
    ])
    mdf.save(WORK / "bench.mf4", overwrite=True)
    maps = [word for own, name in names.items() for word in ("--map", f"{own}={name}")]
    assert identified(WORK / "bench.mf4", *maps) == expected
    # Other units than ours: degrees by the file's word, millinewtonmetres by a scale.
    other = drive.rename(columns=names)
    other["SteeringAngle"] = np.degrees(other["SteeringAngle"])
    other["TorsionBar"] *= 1000.0
    other = other.rename(columns={"SteeringAngle": "SteeringAngle [deg]"})
    other.to_csv(WORK / "bench.csv", index=False)
    maps[maps.index("driver_torque_nm=TorsionBar")] += "*0.001"
    first, second = json.loads(identified(WORK / "bench.csv", *maps)), json.loads(expected)
    flat = lambda value: [x for v in (value.values() if isinstance(value, dict) else value) for x in (
        flat(v) if isinstance(v, (dict, list)) else [v])]
    for a, b in zip(flat(first), flat(second), strict=True):
        assert a == b or (isinstance(a, float) and abs(a - b) <= 1e-5 * max(1e-3, abs(b))), (a, b)


def refused():
    """One sentence each: file, channel, reason."""
    bad = WORK / "bad"
    bad.mkdir(exist_ok=True)
    for name, whole in (("x.parquet", "run.parquet"), ("x.mat", "run.mat"), ("x.mf4", "run.mf4")):
        (bad / name).write_bytes((WORK / whole).read_bytes()[:3000])
        said = host_sim("convert", bad / name, WORK / "never.csv", code=2)
        assert said.startswith(f"error: {bad / name}: ") and said.count("\n") == 1, said
    for arguments, words in (
        (("identify", WORK / "bench.mf4"), ["bench.mf4: there are no channels e_y_m", "--map NAME=CHANNEL"]),
        (("identify", WORK / "run.mf4", "--map", "e_y_m=yaw_rate_rad_per_s"), ["yaw_rate_rad_per_s", '"rad/s"', "one of m"]),
        (("identify", WORK / "run.mf4", "--map", "speed=x"), ["--map speed=x", "is none of time_s"]),
        (("convert", CSV, WORK / "x.xlsx"), ["x.xlsx: the extension .xlsx", ".parquet"]),
        (("convert", CSV, WORK / "x.blf"), ["x.blf: a table of channels has no frames"]),
    ):
        said = host_sim(*arguments, code=2)
        assert all(word in said for word in words), said


def main():
    run = table(CSV)
    written_by_us(run)
    buses()
    edges()
    written_by_them(run)
    foreign_names()
    refused()
    print(
        f"{len(run)} rows of {len(run.columns)} channels and their bus: the same values, units and time stamps in pandas, "
        "pyarrow, scipy.io, asammdf, python-can, cantools and mcap, both ways; --map and refusals hold"
    )


main()
