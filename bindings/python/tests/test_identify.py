"""Identification, against drives whose driver is known."""

import json
from pathlib import Path

import numpy as np
import pytest

import haptic_guidance as hg

LOGS = Path(__file__).parents[3] / "tests" / "data" / "driver-logs"


def table(path):
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    names = lines[0].split(",")
    values = np.array([[float(value) for value in line.split(",")] for line in lines[1:]])
    return dict(zip(names, values.T))


def test_a_path_and_its_columns_give_the_same_driver():
    path = LOGS / "guided-probe-clean.csv"
    by_path, by_columns = hg.identify(path), hg.identify(table(path))
    assert by_path.results["parameters"] == by_columns.results["parameters"]
    truth = json.loads(path.with_suffix(".json").read_text())
    assert abs(by_path["k_hg"].optimum - truth["K_hg"]) < 0.02
    assert abs(by_path["t_p"].optimum - truth["t_p"]) < 0.02


def test_columns_tell_their_speed_as_a_file_does(tmp_path):
    columns = table(LOGS / "guided-probe-clean.csv")
    columns["speed_m_per_s"] = np.linspace(15.0, 25.0, len(columns["time_s"]))
    columns["speed_m_per_s"][7] = np.nan
    path = tmp_path / "drive.csv"
    np.savetxt(path, np.column_stack(list(columns.values())), "%.17g", ",", header=",".join(columns), comments="")
    by_path, by_columns = hg.identify(path), hg.identify(columns)
    told = [found for found in by_columns.results["preflight"]["reading"] if found[0] == "speed"]
    assert len(told) == 1 and told[0][1] == "15.0 to 25.0 m/s"
    assert by_columns.results["balance"] is None
    assert by_path.results["preflight"] == by_columns.results["preflight"]
    assert hg.identify({**columns, "speed_m_per_s": ["?"] * len(columns["time_s"])}).results["balance"] is not None
    with pytest.raises(hg.InputError, match="speed_m_per_s"):
        hg.identify({**columns, "speed_m_per_s": np.zeros(3)})


def probed_run():
    driver = {"t_p_s": 0.2, "k_d_nm_per_rad": 3.0, "k_hg": 0.4, "remnant_sd_nm": 0.02}
    return hg.simulate(hg.Scenario(driver=driver, guidance={"probe": True}))


def test_the_covariance_has_the_variances_on_its_diagonal():
    fit = hg.identify(probed_run())
    names, covariance = fit.covariance
    assert np.allclose(covariance, covariance.T, equal_nan=True)
    for i, name in enumerate(names):
        assert covariance[i, i] == pytest.approx(fit[name].standard_error ** 2)
    assert np.nanmin(np.linalg.eigvalsh(covariance)) > 0
    assert len(fit.traces["time_s"]) == len(fit.traces["residual_nm"])


def test_a_simulated_run_is_a_drive():
    fit = hg.identify(probed_run(), fix={"k_nms": 1.0, "t_nms": 0.1})
    assert fit.refuted == [] and fit["k_hg"].identified
    low, high = fit["k_hg"].interval_95
    assert low <= fit["k_hg"].estimate <= high
    assert abs(fit["t_p"].estimate - 0.2) < 3 * fit["t_p"].standard_error
    assert abs(fit["k_hg"].estimate - 0.4) < 3 * fit["k_hg"].standard_error


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t.pop("e_y_m"), "e_y_m"),
        (lambda t: t.update(e_y_m=t["e_y_m"][:-1]), "rows"),
        (lambda t: t.update(e_y_m=np.zeros((2, 2))), "dimensions"),
        (lambda t: t.update(wheel_angle_rad=np.degrees(t["wheel_angle_rad"])), "degrees"),
        (lambda t: t["time_s"].__setitem__(7, 0.0), "row 8"),
        (lambda t: t["time_s"].__setitem__(slice(900, None), t["time_s"][900:] + 1.7e9), "row 901: the time goes from"),
    ],
)
def test_columns_that_are_no_drive_are_refused(change, says):
    columns = table(LOGS / "guided-probe-clean.csv")
    change(columns)
    with pytest.raises(hg.InputError, match=says):
        hg.identify(columns)


def test_a_row_without_a_time_is_left_out_and_said_to_be():
    columns = table(LOGS / "guided-probe-clean.csv")
    columns["time_s"][5] = np.nan
    assert ("1 row", "no time, in row 6", "left out") in hg.identify(columns).reading


def test_a_stretch_and_more_parameters_can_be_asked_for():
    run = probed_run()
    half = hg.identify(run, between_s=[(0.0, 100.0)], estimate={"t_nms": (0.06, 0.2)})
    assert half.results["rows"] < 0.6 * len(run)
    with pytest.raises(hg.InputError, match="a_1"):
        hg.identify(run, estimate={"a_1": None})
    with pytest.raises(hg.InputError, match="not after"):
        hg.identify(run, between_s=[(10.0, 5.0)])


def test_gaps_lanes_and_rows_are_taken_as_asked():
    run = probed_run()
    columns = {name: column.copy() for name, column in run.columns.items()}
    # Half a second of the torque is lost.
    columns["driver_torque_nm"][4000:4100] = np.nan
    asked = lambda **options: hg.identify(columns, **options).results
    default = asked()
    assert asked(max_gap=0.3, preprocessing=True, lane_smoothing=True) == default
    bridged = asked(max_gap=1.0)
    assert bridged["rows"] > default["rows"] and bridged["parameters"] != default["parameters"]
    # Half of the drive nobody holds the wheel: without preprocessing these rows count too.
    free = {name: column.copy() for name, column in run.columns.items()}
    free["driver_torque_nm"][: len(run) // 2] = 0.0
    assert hg.identify(free, preprocessing=False).results["rows"] > hg.identify(free).results["rows"]
    noisy = {**run.columns, "e_y_m": run["e_y_m"] + np.random.default_rng(1).normal(0.0, 0.03, len(run))}
    smoothed, taken = hg.identify(noisy), hg.identify(noisy, lane_smoothing=False)
    assert smoothed.results["parameters"] != taken.results["parameters"]
    for gap in (-0.1, 1.5, float("nan")):
        with pytest.raises(hg.RangeError, match="max_gap = .* s is outside 0 to 1 s"):
            hg.identify(columns, max_gap=gap)


def test_beside_a_power_assist_a_small_torque_is_no_wrong_one():
    run = probed_run()
    scale = "driver_torque_nm and guidance_torque_nm have one scale"

    def told(factor, **how):
        columns = {**run.columns, "driver_torque_nm": factor * run["driver_torque_nm"]}
        return scale in [r["assumption"] for r in hg.identify(columns, **how).results["refuted"]]

    assert told(0.6) and not told(0.6, assisted=True)
    # A torque that is recorded too large is told all the same.
    assert told(1.6) and told(1.6, assisted=True)


def test_several_drives_of_one_driver_are_one_fit():
    driver = {"t_p_s": 0.2, "k_d_nm_per_rad": 3.0, "k_hg": 0.4, "remnant_sd_nm": 0.02}
    one, other = (hg.simulate(hg.Scenario(driver=driver, seed=seed, guidance={"probe": True})) for seed in (1, 2))
    alone, both = hg.identify(one), hg.identify(one, also=[other.columns])
    assert both.results["rows"] > 1.8 * alone.results["rows"]
    assert both["k_hg"].standard_error < 0.85 * alone["k_hg"].standard_error
    assert abs(both["k_hg"].estimate - 0.4) < 3 * both["k_hg"].standard_error
    log = LOGS / "guided-probe-clean.csv"
    assert hg.identify(log, also=[log]).results["parameters"] == hg.identify(table(log), also=[log]).results["parameters"]
    for wrong, says in [(dict(also=log), "a list of drives"), (dict(also=[log], as_published=True), "takes one drive"),
                        (dict(also=["no-such.csv"]), "no-such")]:
        with pytest.raises(hg.InputError, match=says):
            hg.identify(log, **wrong)


def test_a_parameter_that_there_is_not_is_named():
    fit = hg.identify(LOGS / "guided-probe-clean.csv")
    with pytest.raises(KeyError, match="no 'K_HG'; did you mean 'k_hg'\\? There are gain_1, "):
        fit["K_HG"]


FOREIGN = {
    "time_s": "t",
    "e_y_m": "Lane Offset",
    "e_theta_rad": "LaneHeading",
    "wheel_angle_rad": "SteeringAngle*0.017453292519943295",
    "guidance_torque_nm": "Motor * 0.001",
    "driver_torque_nm": "TorsionBar*-1",
}


def foreign():
    """The columns of a log by the names and units of another tool."""
    columns = table(LOGS / "guided-probe-clean.csv")
    return {
        "t": columns["time_s"],
        "Lane Offset": columns["e_y_m"],
        "LaneHeading": columns["e_theta_rad"],
        "SteeringAngle": np.degrees(columns["wheel_angle_rad"]),
        "Motor": 1e3 * columns["guidance_torque_nm"],
        "TorsionBar": -columns["driver_torque_nm"],
        "Speed [km/h]": np.linspace(50.0, 60.0, len(columns["time_s"])),
        "T_d (Nm)": columns["driver_torque_nm"],
        "Comment": ["a"] * len(columns["time_s"]),
    }


def test_columns_and_files_of_other_names_and_units_are_mapped(tmp_path):
    expected = hg.identify(LOGS / "guided-probe-clean.csv")
    columns = foreign()
    path = tmp_path / "bench.csv"
    names = [name for name in columns if name != "Comment"]
    rows = [",".join(names)] + [",".join(repr(float(v)) for v in row) for row in zip(*(columns[n] for n in names))]
    path.write_text("\n".join(rows) + "\n")
    for drive in (columns, path):
        fit = hg.identify(drive, map=FOREIGN)
        for name in ("t_p", "gain_3", "k_hg"):
            assert fit[name].estimate == pytest.approx(expected[name].estimate, rel=1e-4), name
    columns["angle [deg]"] = columns["SteeringAngle"]
    named = dict(FOREIGN, speed_m_per_s="Speed [km/h]", driver_torque_nm="T_d (Nm)", wheel_angle_rad="angle")
    fit = hg.identify(columns, map=named)
    assert fit["k_hg"].estimate == pytest.approx(expected["k_hg"].estimate, rel=1e-4)
    assert ["speed", "13.9 to 16.7 m/s"] in [found[:2] for found in fit.results["preflight"]["reading"]]
    pandas = pytest.importorskip("pandas")
    assert hg.identify(pandas.DataFrame(columns), map=FOREIGN)["t_p"].identified


def test_a_recording_of_the_bus_takes_another_vehicle_and_another_bus(tmp_path):
    driver = {"t_p_s": 0.2, "k_hg": 0.4, "remnant_sd_nm": 0.02}
    bus = hg.simulate(hg.Scenario(driver=driver, guidance={"probe": True}), bus=True).bus
    trace = tmp_path / "bus.log"
    lines = (f"({t / 1e6:.6f}) can0 {i:03X}#{d.tobytes().hex().upper()}" for t, i, d in zip(*map(bus.get, ("t_us", "id", "data"))))
    trace.write_text("\n".join(lines) + "\n")
    own = hg.identify(trace, dbc=Path(__file__).parents[3] / "core" / "haptic.dbc")
    assert own.results["parameters"] == hg.identify(trace).results["parameters"]
    heavy = hg.identify(trace, vehicle=hg.Scenario(vehicle={"l_f_m": 1.4, "k_f_n_per_rad": 30_000.0}))
    assert heavy.results["parameters"] != own.results["parameters"]
    with pytest.raises(hg.InputError, match="none.dbc"):
        hg.identify(trace, dbc="none.dbc")
    with pytest.raises(TypeError):
        hg.identify(trace, vehicle="heavy")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (dict(map={"e_y": "t"}), 'e_y=t: "e_y" is none of time_s'),
        (dict(map={"e_y_m": "Offset"}), "there is no channel Offset"),
        (dict(map={"e_y_m": "Comment"}), "there is no channel Comment"),
        (dict(map={"e_y_m": "t*0"}), 'the factor "[a-z0-9]*" is no number other than 0'),
        (dict(map={"e_y_m": "t*inf"}), 'the factor "[a-z0-9]*" is no number other than 0'),
        (dict(map={"e_y_m": "t*wide"}), 'the factor "[a-z0-9]*" is no number other than 0'),
        (dict(dbc="core/haptic.dbc"), "dbc: only for a recording of the bus"),
        (dict(vehicle=hg.Scenario()), "vehicle: only for a recording of the bus"),
        (dict(layout="openlka"), "layout: only for a file"),
    ],
)
def test_a_mapping_that_cannot_be_is_refused(options, says):
    with pytest.raises(hg.InputError, match=says):
        hg.identify(foreign(), **options)


def test_what_was_left_out_is_told_and_the_time_has_a_name_and_a_unit(tmp_path):
    table_ = table(LOGS / "guided-probe-clean.csv")
    names = list(table_)
    path = tmp_path / "drive.csv"
    rows = [[f"{1e3 * row[0]:.6f}", *map(repr, map(float, row[1:])), ""] for row in zip(*table_.values())]
    rows[0][-1] = "0.5"
    rows[7][-1] = "left"
    heading = ["t", *names[1:], "speed_kmh"]
    path.write_text("\n".join(map(",".join, [heading, *rows])) + "\n")
    fit = hg.identify(path, time="t [ms]")
    assert ("1 channel (speed_kmh)", 'line 9: speed_kmh is "left", which is not a number', "left out") in fit.reading
    assert fit["k_hg"].identified == hg.identify(LOGS / "guided-probe-clean.csv")["k_hg"].identified
    with pytest.raises(hg.InputError, match="time: map names time_s too"):
        hg.identify(path, time="t [ms]", map={"time_s": "t"})


def test_a_mapping_of_a_file_is_refused_by_name():
    for given, says in [({"e_y": "t"}, "e_y"), ({"e_y_m": "none"}, "none"), ({"e_y_m": "t*0"}, "factor")]:
        with pytest.raises(hg.InputError, match=says):
            hg.identify(LOGS / "guided-probe-clean.csv", map=given)


def test_a_layout_takes_the_shared_stretch_of_somebody_elses_recording():
    recording = LOGS.parent / "layouts" / "openlka.csv"
    low, high = hg.identify(recording, layout="openlka")["k_hg"].interval_95
    assert low <= 0.3 <= high
    for layout, says in [("open-lka", "one of openlka"), ("udacity", "15 fields where the header has 12")]:
        with pytest.raises(hg.InputError, match=says):
            hg.identify(recording, layout=layout)


def test_what_cannot_be_fixed_is_refused():
    with pytest.raises(hg.InputError, match="k_x"):
        hg.identify(LOGS / "manual.csv", fix={"k_x": 1.0})
    with pytest.raises(hg.InputError, match="no-such"):
        hg.identify("no-such.csv")


def test_a_driver_who_changes_is_fitted_in_pieces():
    run = hg.simulate(
        hg.Scenario(
            driver={"t_p_s": 0.2, "k_d_nm_per_rad": 3.0, "k_hg": 0.9, "remnant_sd_nm": 0.072},
            guidance={"probe": True},
            driver_change={"time_s": 90.0, "k_d_nm_per_rad": 3.0, "k_hg": 0.4},
        )
    )
    whole = hg.identify(run)
    assert whole["k_hg"].estimate is None and whole.refuted[0]["cause"].startswith("the driver changed at")
    assert whole.pieces == [] and whole.changes == []
    fit = hg.identify(run, pieces=True)
    (change,) = fit.changes
    assert change.parameter == "k_hg" and abs(change.at_s[0] - 90.0) < 5.0
    assert change.at_95_s[0][0] < 90.0 < change.at_95_s[1][1]
    before, after = fit.pieces
    assert before.to_s < 90.0 < after.from_s
    for piece, truth in ((before, 0.9), (after, 0.4)):
        assert abs(piece["k_hg"].estimate - truth) < 0.06
    with pytest.raises(hg.InputError, match="pieces"):
        hg.identify(run, pieces=True, as_published=True)
