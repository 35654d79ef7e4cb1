"""What a run says of when the guidance left, against the frames of its bus, decoded here as core/haptic.dbc has them."""

import csv

import numpy as np
import pytest

import haptic_guidance as hg

# A left curve of a radius of 800 m, held for a minute at 60 km/h.
HELD = {
    "segment": [
        {"length_m": 200.0},
        {"length_m": 100.0, "curvature_start_per_m": 0.0, "curvature_end_per_m": 0.00125},
        {"length_m": 1000.0, "curvature_per_m": 0.00125},
    ]
}
# A camera that is blind for 1.5 s now and then: the ECU hands over after a second of that.
BLIND = {"dropout_rate_per_s": 0.2, "dropout_duration_s": 1.5}
RELIANCES = ("high", "mid", "low")
MODES = ("Boot", "Standby", "Active", "Fade", "Handover", "Fault", "Locked")
FAULTS = {0: "LaneTimeout", 19: "HandsOff"}


def mode_and_faults(data):
    word = int.from_bytes(bytes(data), "little")
    return MODES[word >> 32 & 0xF], tuple(FAULTS[i] for i in range(21) if word >> 37 + i & 1)


def said(bus):
    """Mode and faults from the start and at each change."""
    changes = []
    for t_us, number, data in zip(bus["t_us"], bus["id"], bus["data"]):
        if number == 0x0C0 and (not changes or changes[-1][1:] != mode_and_faults(data)):
            changes.append((t_us * 1e-6, *mode_and_faults(data)))
    return changes


@pytest.mark.parametrize("errors", [{}, BLIND], ids=["sees", "blind"])
@pytest.mark.parametrize("condition", RELIANCES)
def test_a_run_says_what_its_bus_says(condition, errors):
    run = hg.simulate(hg.Scenario(course=HELD, condition=condition, sensor_errors=errors), bus=True)
    expected = said(run.bus)
    assert [one[1:] for one in run.said] == [one[1:] for one in expected]
    assert np.allclose([one[0] for one in run.said], [one[0] for one in expected])
    left = next((one for one in expected if one[1] != "Active"), None)
    assert run.left_by_itself == (left is not None) == (run.results["guidance_left_s"] is not None)
    if left is None:
        assert not errors and run.unguided == [] and not run["unguided_cause"].any()
        return
    (stretch,) = run.unguided
    assert stretch["why"] == "+".join(left[2]) == run.results["guidance_left_why"] and not stretch["asked_for"]
    assert -1e-9 <= stretch["from_s"] - left[0] < 0.005 and stretch["until_s"] is None
    away = run["time_s"] >= stretch["from_s"]
    assert np.array_equal(run["unguided_cause"] != 0, away) and repr(run).count(stretch["why"]) == 1
    assert run.results["unguided_s"] == stretch["lasts_s"] == pytest.approx(run["time_s"][-1] - stretch["from_s"])


def test_each_step_says_what_the_bus_says():
    scenario = hg.Scenario(course=HELD, condition="mid", sensor_errors=BLIND, guidance={"probe": True})
    simulation, k_hg, modes, read = hg.Simulation(scenario), None, set(), 0
    while (outcome := simulation.step()) is not None:
        frames = {frame.id: frame.data for frame in outcome.frames_out}
        mode, faults = mode_and_faults(frames[0x0C0])
        assert (outcome.mode, outcome.faults) == (mode, faults)
        assert outcome.warning == bool(int.from_bytes(frames[0x0C0], "little") >> 36 & 1)
        assert (outcome.unguided is None) == (mode == "Active")
        if 0x310 in frames:
            word = int.from_bytes(frames[0x310], "little")
            value = (word >> 26 & 0x3FFF) - (word >> 25 + 14 & 1) * 0x4000
            k_hg = (value / 1024, (word >> 40 & 0x7FF) / 1024) if word >> 25 & 1 else None
            read += k_hg is not None
        assert outcome.k_hg == k_hg
        modes.add(mode)
    assert {"Active", "Handover", "Standby"} <= modes
    run = hg.simulate(scenario)
    assert np.count_nonzero(np.isfinite(run.k_hg["k_hg"])) == read == np.count_nonzero(np.isfinite(run.k_hg["sd"]))


def test_what_a_scenario_lets_fail_is_asked_for():
    run = hg.simulate(hg.Scenario(course=HELD, condition="low", failure={"kind": "torque", "time_s": 20}))
    (stretch,) = run.unguided
    assert (stretch["why"], stretch["asked_for"], stretch["from_s"]) == ("torque lost", True, 20.0)
    assert not run.left_by_itself
    manual = hg.simulate(hg.Scenario(course=HELD, condition="manual"))
    assert manual.unguided == [] and manual.said == [] and manual.results["unguided_s"] is None
    assert hg.Simulation(manual.scenario).step().mode is None


def test_the_figure_shades_it():
    pytest.importorskip("matplotlib")
    run = hg.simulate(hg.Scenario(course=HELD, sensor_errors=BLIND))
    for panel in run.figure().axes:
        (span,) = panel.patches
        assert span.get_label() == "no guidance: LaneTimeout"
        assert span.get_extents().transformed(panel.transData.inverted()).x0 == pytest.approx(run.unguided[0]["from_s"])


def test_an_evaluation_with_unguided_runs_is_not_held():
    evaluation = hg.evaluate(hg.Scenario(course=HELD, failure={"time_s": 10.0}, sensor_errors=BLIND))
    left = [run for run in evaluation.results["runs"] if run["guidance_left_why"] in FAULTS.values()]
    assert len(left) >= 9 and not evaluation.all_claims_hold
    told = f"the ECU ended guidance by itself in {len(left)} of 30 runs"
    assert evaluation.results["claims"][-1]["evidence"].startswith(told)


def test_a_sweep_has_columns_for_it(tmp_path):
    pyarrow_parquet = pytest.importorskip("pyarrow.parquet")
    segments = "".join(
        f"[[scenario.course.segment]]\nlength_m = {length}\ncurvature_start_per_m = {start}\ncurvature_end_per_m = {end}\n"
        for length, start, end in ((200.0, 0.0, 0.0), (400.0, 0.00125, 0.00125))
    )
    spec = tmp_path / "sweep.toml"
    spec.write_text(
        'metrics = ["sdlp_m"]\n[scenario.course]\nname = "c"\nlane_width_m = 3.6\n'
        + segments
        + '[scenario.sensor_errors]\ndropout_duration_s = 1.5\n[vary]\ncondition = ["manual", "high"]\n"sensor_errors.dropout_rate_per_s" = [0, 0.2]\n'
    )
    result = hg.sweep(spec, out=tmp_path / "out")
    rows = list(csv.DictReader(result.csv.open()))
    whys = {(row["condition"], row["sensor_errors.dropout_rate_per_s"]): row["guidance_left_why"] for row in rows}
    assert whys == {("manual", "0"): "", ("manual", "0.2"): "", ("high", "0"): "", ("high", "0.2"): "LaneTimeout"}
    assert result.summary["left_by_itself"] == 1 and result.summary["left_why"] == {"LaneTimeout": 1}
    table = pyarrow_parquet.read_table(result.parquet).to_pylist()
    for row, other in zip(rows, table):
        for name in ("guidance_left_s", "guidance_back_s", "unguided_s"):
            assert other[name] == (float(row[name]) if row[name] else None), name
        assert other["guidance_left_why"] == row["guidance_left_why"]
