"""A sweep on several engines, one whose workers are killed: the same bytes."""

import csv
import os
import signal
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import pytest

import haptic_guidance as hg

SPEC = """
samples = 200
design = "sobol"
[scenario.failure]
kind = "torque"
[scenario.course]
name = "one curve"
lane_width_m = 3.6
segment = [{ length_m = 60.0 }, { length_m = 140.0, curvature_per_m = 0.003 }]
[vary]
"driver.t_p_s" = { uniform = [0.1, 0.5] }
"failure.time_s" = { uniform = [4, 8] }
"""


@pytest.fixture
def spec(tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(SPEC)
    return path


def files(result):
    names = ["drives.csv", "drives.parquet", "sweep.toml"]
    return [(result.directory / name).read_bytes() for name in names]


def test_a_package_without_parquet_says_so(tmp_path):
    with pytest.raises(FileNotFoundError, match="built without Parquet.*drives.csv"):
        hg.SweepResult(tmp_path, {}).parquet


def test_rows_are_the_runs_of_their_scenarios(spec, tmp_path):
    result = hg.sweep(spec, out=tmp_path / "threads")
    rows = list(csv.DictReader(result.csv.open()))
    assert len(rows) == result.summary["drives"] == 200
    row = rows[137]
    scenario = hg.Scenario(
        driver={"t_p_s": float(row["driver.t_p_s"])},
        failure={"kind": "torque", "time_s": float(row["failure.time_s"])},
        seed=int(row["seed"]),
        course={
            "name": "one curve",
            "lane_width_m": 3.6,
            "segment": [
                {"length_m": 60.0, "curvature_start_per_m": 0.0, "curvature_end_per_m": 0.0},
                {"length_m": 140.0, "curvature_start_per_m": 0.003, "curvature_end_per_m": 0.003},
            ],
        },
    )
    run = hg.simulate(scenario)
    assert float(row["peak_lateral_error_m"]) == run.metrics["peak_lateral_error_m"]


def test_the_table_is_read_by_pandas(spec, tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    result = hg.sweep(spec, out=tmp_path / "threads")
    table = pandas.read_parquet(result.parquet)
    text = pandas.read_csv(result.csv)
    assert list(table.columns) == list(text.columns)
    assert (table["drive"] == list(range(200))).all()
    for name in ["driver.t_p_s", "peak_lateral_error_m", "end_m", "min_time_to_lane_crossing_s"]:
        pandas.testing.assert_series_equal(table[name], text[name], check_exact=False, rtol=1e-15)
    assert table["diverged"].dtype == bool


def test_processes_give_the_same_bytes_and_a_sweep_goes_on(spec, tmp_path):
    whole = files(hg.sweep(spec, out=tmp_path / "threads"))
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert files(hg.sweep(spec, pool, out=tmp_path / "processes")) == whole
    for chunk in list((tmp_path / "processes" / "chunks").iterdir())[::3]:
        chunk.unlink()
    calls = []
    again = hg.sweep(spec, out=tmp_path / "processes", progress=lambda done, of: calls.append((done, of)))
    assert files(again) == whole
    assert 0 < len(calls) < calls[-1][1] and calls[-1][0] == calls[-1][1]


def test_ctrl_c_ends_a_sweep_and_what_is_under_way(tmp_path, monkeypatch):
    """Of 2000 chunks, 256 of them handed out, those on this machine's cores are given up and no other begins."""
    path, begun, ended = tmp_path / "sweep.toml", [], []
    path.write_text(SPEC.replace("samples = 200", "samples = 512000"))

    class Counting(ThreadPoolExecutor):
        def submit(self, fn, *arguments):
            def counted():
                begun.append(None)
                try:
                    return fn(*arguments)
                finally:
                    ended.append(sys.exc_info()[0])

            return super().submit(counted)

    monkeypatch.setattr("haptic_guidance._sweep.ThreadPoolExecutor", Counting)
    kept = []

    def interrupt(done, of):
        kept.append(done)
        if done == 3:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        hg.sweep(path, out=tmp_path / "out", progress=interrupt)
    # Nothing is under way any more, and what was ended without its chunk.
    cores = os.cpu_count()
    assert len(ended) == len(begun) <= kept[-1] + 4 * cores
    assert KeyboardInterrupt in ended
    # The chunks that are done are kept.
    assert len(list((tmp_path / "out" / "chunks").iterdir())) == kept[-1]


def test_bad_input_is_not_tried_again(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text("samples = 4\n[vary]\nspeed_m_per_s = { uniform = [14, 80] }\n")
    with pytest.raises(hg.InputError, match="speed_m_per_s = .* is outside 5.5 to 70 m/s"):
        hg.sweep(path, out=tmp_path / "out")


def test_killed_workers_of_a_dask_cluster_cost_only_their_chunk(spec, tmp_path):
    distributed = pytest.importorskip("distributed")
    whole = files(hg.sweep(spec, out=tmp_path / "threads"))
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    )
    stop = threading.Event()
    killed = []

    def kill(client):
        while not stop.wait(0.5) and len(killed) < 4:
            workers = [nanny.pid for nanny in cluster.workers.values() if nanny.pid]
            if workers:
                pid = workers[len(killed) % len(workers)]
                os.kill(pid, signal.SIGKILL)
                killed.append(pid)

    with cluster, distributed.Client(cluster) as client:
        killer = threading.Thread(target=kill, args=(client,))
        killer.start()
        try:
            result = hg.sweep(spec, client, out=tmp_path / "dask", in_flight=8, retries=20)
            while not killed:
                time.sleep(0.1)
        finally:
            stop.set()
            killer.join()
    assert files(result) == whole
    assert killed
