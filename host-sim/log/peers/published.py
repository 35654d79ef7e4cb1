"""Test files that other projects publish with their packages, read by `host-sim convert` and by the package itself:
equal, or refused or left out in words.

    published.py HOST_SIM DIRECTORY

DIRECTORY has the unpacked sources of python-can, cantools and asammdf; the files of SciPy, pyarrow and canmatrix lie where they
are installed. Frames of DBC files are drawn at random. Files of MATLAB and Parquet get a time, which they lack, in a copy.
"""

import importlib.util
import io
import json
import random
import subprocess
import sys
import warnings
from pathlib import Path

import asammdf
import can
import canmatrix
import cantools
import numpy as np
import pandas
import pyarrow
import pyarrow.parquet
import scipy.io

HOST_SIM, WORK = sys.argv[1], Path(sys.argv[2])
OUT = WORK / "out"
CAN, CANTOOLS, ASAMMDF = (next(WORK.glob(f"{name}-*/")) for name in ("python_can", "cantools", "asammdf"))
warnings.simplefilter("ignore")
verdicts = []


def host_sim(*arguments):
    done = subprocess.run([HOST_SIM, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode in (0, 2), (arguments, done.stderr)
    return done


def judge(package, path, *options, equal, output="o.csv"):
    """Reads a file; `equal` compares what came out, and says whether it was all. What was not has to be said in words."""
    done = host_sim("convert", "--force", path, OUT / output, *options)
    if done.returncode == 2:
        # The log that was made for a DBC file has its name.
        begin, name, rest = done.stderr.partition(f"{path.name.removesuffix('.log')}")
        assert begin.startswith("error: ") and name and rest.count("\n") == 1, done.stderr
        verdict = "refused: " + rest.split(": ", 1)[1].strip()
    else:
        missing = equal(OUT / output, done.stderr)
        said = "; ".join(line.removeprefix("note: ") for line in done.stderr.splitlines() if line.startswith("note: "))
        verdict = "equal" if not (missing or said) else f"equal but for {missing or said}"
    tell(package, path, verdict)


def tell(package, path, verdict):
    print(f"{package:<11} {path.name}: {verdict[:200]}", flush=True)
    verdicts.append(verdict.split()[0].strip(":"))


def table(path, listed):
    """Channels of a CSV file by their names, in the order of the list, because two may differ in the unit alone."""
    frame = pandas.read_csv(path, float_precision="round_trip")
    named = [channel["name"] for channel in listed["channels"]]
    twice = {name for name in named if named.count(name) > 1}
    assert not twice and len(named) == len(frame.columns) - 1, (path, sorted(twice))
    return dict(zip(named, (frame.iloc[:, i + 1] for i in range(len(named)))))


def same(ours, theirs, what):
    ours, theirs = np.asarray(ours, float), np.asarray(theirs, float)
    assert ours.shape == theirs.shape and np.allclose(ours, theirs, rtol=1e-9, atol=0, equal_nan=True), (what, ours, theirs)


def logs():
    for path in sorted((CAN / "test/data").glob("*")):
        if path.suffix not in (".asc", ".blf"):
            continue
        theirs = [f for f in can.LogReader(path) if not (f.is_error_frame or f.is_remote_frame)]

        def equal(made, said):
            ours = list(can.LogReader(made))
            assert len(theirs) == len(ours), (path, said, len(theirs), len(ours))
            for a, b in zip(ours, theirs):
                head = (a.arbitration_id, a.is_extended_id, a.is_fd) == (b.arbitration_id, b.is_extended_id, b.is_fd)
                assert head and a.data == b.data and abs(a.timestamp - b.timestamp) < 2e-6, (path, a, b)

        judge("python-can", path, equal=equal, output="o.log")


def meanings():
    """Up to twenty frames of every message of a DBC file, drawn at random, as cantools decodes them."""
    draw = random.Random(1)
    asammdf_own = [ASAMMDF / "test/almost-J1939.dbc"]
    canmatrix_own = sorted(Path(canmatrix.__file__).parent.glob("**/*.dbc"))
    for package, paths in (
        ("cantools", sorted((CANTOOLS / "tests/files/dbc").glob("*.[dD][bB][cC]"))),
        ("asammdf", asammdf_own), ("canmatrix", canmatrix_own),
    ):
        for path in paths:
            try:
                database = cantools.database.load_file(path, database_format="dbc", strict=False)
            except Exception as reason:
                tell(package, path, f"cantools reads it not: {str(reason)[:60]}")
                continue
            if not database.messages:
                continue
            expected, log, at = {}, OUT / f"{path.name}.log", 0.0
            with open(log, "w") as file:
                for message in database.messages:
                    head = f"can0 {message.frame_id:0{8 if message.is_extended_frame else 3}X}"
                    wanted = 20 if len(database.messages) < 50 else 3
                    # Most numbers of a row are none that a message has.
                    for _ in range(500):
                        data = draw.randbytes(message.length)
                        try:
                            decoded = message.decode(data, decode_choices=False)
                        except cantools.database.DecodeError:
                            continue
                        at += 0.001
                        file.write(f"({at:.3f}) {head}{'##0' if message.length > 8 else '#'}{data.hex()}\n")
                        for name, value in decoded.items():
                            if not np.isnan(value):
                                expected.setdefault((message.name, name), []).append((at, float(value)))
                        wanted -= 1
                        if wanted == 0:
                            break
            if not expected:
                tell(package, path, "cantools decodes no frame of it")
                continue

            def equal(made, said):
                listed = json.loads(host_sim("convert", log, "--dbc", path, "--json").stdout)
                time = pandas.read_csv(made, usecols=["time_s"])["time_s"]
                ours, renamed = table(made, listed), []
                ours = {name: list(zip(time[own.notna()], own.dropna())) for name, own in ours.items()}
                for (message, name), values in expected.items():
                    own = ours.get(f"{message}.{name}", ours.get(name, []))
                    if len(own) != len(values) or not np.allclose(own, values, rtol=1e-9, atol=0):
                        # cantools takes long names from an attribute.
                        others = [own for own in ours.values() if len(own) == len(values)]
                        assert any(np.allclose(own, values, rtol=1e-9, atol=0) for own in others), (path, message, name)
                        renamed.append(name)
                return renamed and f"the names of {len(renamed)} signals"

            judge(package, log, "--dbc", path, equal=equal)


def matlab():
    own = Path(scipy.io.__file__).parent
    for path in sorted(own.glob("matlab/tests/data/*.mat")):
        try:
            theirs = scipy.io.loadmat(path)
        except Exception as reason:
            theirs = {}
        theirs = {name: value for name, value in theirs.items() if not name.startswith("__")}
        numbers = {n: v for n, v in theirs.items() if isinstance(v, np.ndarray) and v.dtype.kind in "fiub" and v.ndim == 2}
        rows = max((max(v.shape) for v in numbers.values()), default=9)
        time = io.BytesIO()
        scipy.io.savemat(time, {"time_s": np.arange(float(rows))})
        timed = OUT / path.name
        # A variable more, behind those that are there.
        timed.write_bytes(path.read_bytes() + time.getvalue()[128:])

        def equal(made, said):
            listed = json.loads(host_sim("convert", timed, "--json").stdout)
            ours = table(made, listed)
            named = {name for note in listed["notes"] for name in note.get("names", [])}
            for name, value in theirs.items():
                if name in named or any(own.startswith(f"{name}.") for own in named):
                    continue
                value = np.atleast_2d(value)
                value = value if value.shape[1] == rows else value.T
                for i, line in enumerate(value):
                    same(ours[name if len(value) == 1 else f"{name}.{i + 1}"], line, (path, name))
            return ", ".join(sorted(named))

        judge("scipy", timed, equal=equal)


def parquet():
    own = Path(pyarrow.__file__).parent
    for path in sorted(own.glob("tests/data/parquet/*.parquet")):
        theirs = pyarrow.parquet.read_table(path)
        timed = OUT / path.name
        pyarrow.parquet.write_table(theirs.append_column("time_s", [np.arange(float(len(theirs)))]), timed)

        def equal(made, said):
            listed = json.loads(host_sim("convert", timed, "--json").stdout)
            ours = table(made, listed)
            named = {name for note in listed["notes"] for name in note.get("names", [])}
            for name in theirs.column_names:
                if name not in named:
                    column = theirs[name].to_pandas()
                    # Dates stand as counts of the unit that the column has.
                    same(ours[name], column.astype("int64") if column.dtype.kind == "M" else column, (path, name))
            return ", ".join(sorted(named))

        judge("pyarrow", timed, equal=equal)


def measurements():
    paths = sorted((ASAMMDF / "test/asammdf/gui/resources").glob("*.mf4"))
    source = importlib.util.spec_from_file_location("utils", ASAMMDF / "test/utils.py")
    utils = importlib.util.module_from_spec(source)
    source.loader.exec_module(utils)
    for version in utils.SUPPORTED_VERSIONS:
        utils.generate_test_file(OUT, version)
    utils.generate_arrays_test_file(OUT)
    for path in paths + sorted(OUT.glob("*_test_*.m*")):
        mdf = asammdf.MDF(path)

        def equal(made, said):
            listed = json.loads(host_sim("convert", path, "--json").stdout)
            ours = [column.dropna().to_numpy() for column in table(made, listed).values()]
            names = [channel["name"] for channel in listed["channels"]]
            named = [name for note in listed["notes"] for name in note.get("names", [])]
            for g, group in enumerate(mdf.groups):
                for c, channel in enumerate(group.channels):
                    if channel.channel_type in (2, 3) or mdf.masters_db.get(g) == c:
                        continue
                    signal = mdf.get(group=g, index=c)
                    if signal.samples.dtype.kind not in "fiub":
                        # Codes with names stay codes.
                        signal = mdf.get(group=g, index=c, raw=True)
                    if signal.samples.dtype.names:
                        # A structure, whose parts are channels themselves, or an array with its axes.
                        continue
                    is_number = signal.samples.dtype.kind in "fiub" and signal.samples.ndim == 1
                    theirs = signal.samples.astype(float) if is_number else None
                    is_own = [n == channel.name or n.endswith(f".{channel.name}") for n in names]
                    own = [values for values, it in zip(ours, is_own) if it and is_number and len(values) == len(theirs)]
                    if not any(np.allclose(values, theirs, rtol=1e-9, atol=0) for values in own):
                        # Elements of an array go with it.
                        name = channel.name if "[" not in channel.name else channel.name.split("[")[0]
                        assert name in named, (path, channel.name)
                        if name == channel.name:
                            named.remove(name)
            return ", ".join(sorted(set(n for note in listed["notes"] for n in note.get("names", []))))[:100]

        judge("asammdf", path, equal=equal)


def main():
    OUT.mkdir(exist_ok=True)
    for part in (logs, meanings, matlab, parquet, measurements):
        part()
    equal, refused = verdicts.count("equal"), verdicts.count("refused")
    others = len(verdicts) - equal - refused
    print(f"{equal} files equal or left out in words, {refused} refused in words, {others} that their own package does not read")
    assert equal > 100 and refused > 50, verdicts


main()
