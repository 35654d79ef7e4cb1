"""Whole runs, steps and evaluation, against the independent C program's curves and against each other."""

import copy
import csv
import os
import pickle
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import haptic_guidance as hg

DATA = Path(__file__).parents[3] / "tests" / "data"
SHORT = {"segment": [{"length_m": 300.0}, {"length_m": 60.0, "curvature_start_per_m": 0.0, "curvature_end_per_m": 0.002}, {"length_m": 200.0, "curvature_per_m": 0.002}]}


def test_a_run_is_the_curve_of_an_independent_program():
    failing = hg.Scenario(condition="high", driver={"t_p_s": 0.5}, failure={"kind": "torque"}, sensors="exact")
    run = hg.simulate(failing)
    lines = (DATA / "closed_loop_high_tp05_failure70.csv").read_text().splitlines()
    rows = [[float(value) for value in line.split(",")] for line in lines if line[:1].isdigit()]
    assert len(rows) > 390
    for t_s, s_m, error_m, guidance_nm, _, wheel_rad in rows:
        i = round(t_s * 200)
        if i < len(run):
            assert abs(run["s_m"][i] - s_m) < 0.01
            assert abs(run["lateral_error_m"][i] - error_m) < 0.1e-3
            assert abs(run["guidance_torque_nm"][i] - guidance_nm) < 0.1e-3
            assert abs(run["wheel_angle_rad"][i] - wheel_rad) < 0.02e-3


def test_columns_are_arrays_in_time():
    run = hg.simulate(hg.Scenario(course=SHORT))
    assert run.ending == "course-end" and run.steps >= 5 * (len(run) - 1)
    assert np.allclose(np.diff(run["time_s"]), 0.005)
    for name, column in run.columns.items():
        assert column.dtype == np.float64 and column.shape == (len(run),), name
        assert np.isfinite(column).all(), name


def test_metrics_are_those_of_the_columns():
    run = hg.simulate(hg.Scenario(course=SHORT))
    assert run.metrics["peak_lateral_error_m"] == np.abs(run["lateral_error_m"]).max()
    assert run.metrics["rms_driver_torque_nm"] == pytest.approx(np.sqrt(np.mean(run["driver_torque_nm"] ** 2)), rel=1e-9)
    assert run.metrics["time_to_recover_s"] is None


def test_pandas_and_arrow_share_the_memory():
    pandas, pyarrow = pytest.importorskip("pandas"), pytest.importorskip("pyarrow")
    run = hg.simulate(hg.Scenario(course=SHORT))
    frame = run.to_pandas()
    assert isinstance(frame, pandas.DataFrame) and list(frame) == list(run.columns)
    assert np.shares_memory(frame["time_s"].to_numpy(), run["time_s"])
    table = run.to_arrow()
    assert isinstance(table, pyarrow.Table) and table.num_rows == len(run)
    assert table["s_m"].chunk(0).buffers()[1].address == run["s_m"].ctypes.data


def test_whatever_reads_arrow_reads_a_run():
    pandas, pyarrow = pytest.importorskip("pandas"), pytest.importorskip("pyarrow")
    run = hg.simulate(hg.Scenario(course=SHORT))
    # By the PyCapsule interface alone: neither knows a run.
    table = pyarrow.table(run)
    assert table.column_names == list(run.columns)
    assert table["s_m"].chunk(0).buffers()[1].address == run["s_m"].ctypes.data
    stream = pyarrow.RecordBatchReader.from_stream(run).read_all()
    assert stream["e_y_m"].chunk(0).buffers()[1].address == run["e_y_m"].ctypes.data
    if hasattr(pandas.DataFrame, "from_arrow"):
        frame = pandas.DataFrame.from_arrow(run)
        pandas.testing.assert_frame_equal(frame, run.to_pandas(), check_dtype=False)


def test_a_run_has_a_figure(tmp_path):
    pytest.importorskip("matplotlib")
    run = hg.simulate(hg.Scenario(course=SHORT, failure={"kind": "torque", "time_s": 5}))
    figure = run.figure()
    error, torque, wheel = figure.axes
    assert np.array_equal(error.lines[0].get_ydata(), run["lateral_error_m"])
    assert [line.get_label() for line in torque.lines[:2]] == ["driver", "guidance"]
    assert wheel.lines[1].get_xdata()[0] == 5.0, "the failure is marked"
    figure.savefig(tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 10_000


def test_a_run_can_be_pickled():
    run = hg.simulate(hg.Scenario(course=SHORT), bus=True)
    again = pickle.loads(pickle.dumps(run))
    assert again.results == run.results and np.array_equal(again.bus["data"], run.bus["data"])


def test_steps_give_the_samples_of_the_whole_run():
    scenario = hg.Scenario(course=SHORT, condition="high", driver={"remnant_sd_nm": 0.1})
    run, simulation = hg.simulate(scenario), hg.Simulation(scenario)
    row = 0
    while (outcome := simulation.step()) is not None:
        if outcome.sample is not None:
            assert all(outcome.sample[name] == column[row] for name, column in run.columns.items()), row
            row += 1
    assert row == len(run) and simulation.steps == run.steps and simulation.ending == run.ending


def test_a_clone_and_a_pickle_go_on_as_the_original():
    simulation = hg.Simulation(hg.Scenario(course=SHORT, driver={"remnant_sd_nm": 0.1}))
    push = hg.Action(hand_torque_nm=0.7, authority=0.5)
    simulation.step(push, steps=700)
    simulation.step(steps=300)
    others = [simulation.clone(), copy.deepcopy(simulation), pickle.loads(pickle.dumps(simulation))]
    expected = [simulation.step(push) for _ in range(500)]
    for other in others:
        assert other.steps == 1000
        for outcome in expected:
            got = other.step(push)
            assert (got.e_y_m, got.guidance_torque_nm, got.driver_torque_nm) == (
                outcome.e_y_m,
                outcome.guidance_torque_nm,
                outcome.driver_torque_nm,
            )
            assert got.frames_out == outcome.frames_out


def test_an_outcome_can_be_pickled_and_copied():
    simulation = hg.Simulation(hg.Scenario(course=SHORT))
    names = [name for name in dir(hg.Outcome) if not name.startswith("_")]
    assert {"time_s", "sample", "frames_out"} <= set(names)
    for outcome in (simulation.step(), simulation.step()):
        for again in (pickle.loads(pickle.dumps(outcome)), copy.copy(outcome), copy.deepcopy(outcome)):
            assert all(getattr(again, name) == getattr(outcome, name) for name in names)


def test_a_column_that_there_is_not_is_named():
    with pytest.raises(KeyError, match="no 'lateral_eror_m'; did you mean 'lateral_error_m'\\? There are time_s, "):
        hg.simulate(hg.Scenario(course=SHORT))["lateral_eror_m"]


def test_a_hand_on_the_wheel_moves_the_vehicle_to_its_side():
    free, pushed = (hg.Simulation(hg.Scenario(course=SHORT)) for _ in range(2))
    left = pushed.step(hg.Action(hand_torque_nm=0.5), steps=1000)
    assert left.e_y_m < free.step(steps=1000).e_y_m, "the target lies farther to the right"


def test_what_an_action_cannot_be_is_refused():
    with pytest.raises(hg.RangeError) as caught:
        hg.Action(authority=1.5)
    assert (caught.value.field, caught.value.max) == ("authority", 1.0)
    with pytest.raises(hg.RangeError, match="hand_torque_nm"):
        hg.Action(hand_torque_nm=float("nan"))
    for steps in (0, -1, 2**32):
        with pytest.raises(hg.RangeError, match=f"steps = {steps} is outside 1 to 4294967295"):
            hg.Simulation(hg.Scenario()).step(steps=steps)


def test_a_failure_after_the_end_is_refused():
    with pytest.raises(hg.RangeError) as caught:
        hg.simulate(hg.Scenario(course=SHORT, failure={"kind": "torque", "time_s": 1000}))
    assert caught.value.field == "failure.time_s"


def test_a_bus_where_there_is_none_is_refused():
    with pytest.raises(hg.InputError, match="no bus"):
        hg.simulate(hg.Scenario(sensors="exact"), bus=True)


def test_the_evaluation_holds_its_claims_and_tells_its_progress():
    told = []
    evaluation = hg.evaluate(progress=told.append)
    assert sum(told) == len(evaluation.results["runs"]) == len(evaluation.columns) == 30
    assert evaluation.results["claims"] and evaluation.all_claims_hold


def test_progress_is_a_bar_of_tqdm_or_refused(capsys, monkeypatch):
    pytest.importorskip("tqdm")
    hg.experiment([3], progress=True)
    assert "2/2" in capsys.readouterr().err
    with pytest.raises(hg.InputError, match="progress: a str is neither True nor callable"):
        hg.evaluate(progress="yes")
    monkeypatch.setitem(__import__("sys").modules, "tqdm.auto", None)
    with pytest.raises(hg.InputError, match="progress=True needs tqdm"):
        hg.evaluate(progress=True)


def test_the_participants_drive_and_are_identified():
    told = []
    found = hg.experiment([3, 7], probe_nm=0.2, seed=4, progress=told.append)
    assert sum(told) == 4 == len(found.drives)
    drives = found.results["drives"]
    assert [(d["participant"], d["guided"]) for d in drives] == [(3, False), (3, True), (7, False), (7, True)]
    # Table 6 of the paper, participant 7.
    text = (Path(__file__).parents[3] / "host-sim" / "sim" / "data" / "participants.toml").read_text()
    guided = text.split("number = 7")[1].split("guided")[1]
    t_p = float(guided.split("t_p = ")[1].split(",")[0].split("\n")[0].split("}")[0])
    assert drives[3]["truth"]["t_p"] == t_p
    estimate = drives[3]["noise_model"]["parameters"]["t_p"]
    assert abs(estimate["estimate"] - t_p) < 4 * estimate["standard_error"]
    # What was recorded gives the same driver again.
    again = hg.identify(found.drives[3])
    assert abs(again["t_p"].estimate - estimate["estimate"]) < 0.1 * estimate["standard_error"]
    pytest.importorskip("pandas")
    frame = found.to_pandas()
    assert list(frame["participant"]) == [3, 3, 7, 7] and frame["true_t_p"][1] == t_p
    assert frame["k_hg"][1] == drives[1]["noise_model"]["parameters"]["k_hg"]["estimate"]


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        (dict(participants=[15]), hg.RangeError, "participants = 15 is outside 1 to 14"),
        (dict(participants=[-1]), hg.RangeError, "participants = -1 is outside 1 to 14"),
        (dict(participants=[]), hg.InputError, "at least one"),
        (dict(participants=[1.5]), hg.InputError, "whole numbers"),
        (dict(participants="1"), hg.InputError, "whole numbers"),
        (dict(probe_nm=0.4), hg.RangeError, "probe_amplitude_nm = 0.4 N.m is outside 0 to 0.3"),
        (dict(probe_nm=float("nan")), hg.RangeError, "probe_amplitude_nm"),
        (dict(seed=-1), hg.RangeError, "seed = -1 is outside 0"),
    ],
)
def test_what_is_no_experiment_is_refused(arguments, error, says):
    with pytest.raises(error, match=says):
        hg.experiment(**arguments)


def test_ctrl_c_ends_a_long_call_and_the_gil_is_free():
    # 200 km at 20 km/h: ten hours of driving.
    long = hg.Scenario(course={"segment": [{"length_m": 200_000.0}]}, speed_m_per_s=20 / 3.6)
    turns, begun = [], time.monotonic()

    def interrupt():
        # This thread counts while the simulator works: it could not if the call held the interpreter.
        while len(turns) < 20:
            turns.append(None)
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    for call in (lambda: hg.simulate(long), lambda: hg.Simulation(long).step(steps=4_000_000_000)):
        turns.clear()
        thread = threading.Thread(target=interrupt)
        thread.start()
        with pytest.raises(KeyboardInterrupt):
            call()
        thread.join()
        assert len(turns) == 20
