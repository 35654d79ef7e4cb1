"""The examples and the lines of the README, as a reader runs them."""

import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest

import haptic_guidance as hg

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "examples" / "python"


def test_figure_9(tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(EXAMPLES / "figure_9.py"))
    assert (tmp_path / "figure-9.png").stat().st_size > 10_000


def test_a_driver_of_ones_own_stepped_from_outside_drives_as_in_rust():
    errors_m = runpy.run_path(str(EXAMPLES / "own_driver.py"))["drive"]()
    # tests/parts.rs has the same figure of examples/own_driver.rs, to the last digit.
    assert max(map(abs, errors_m)) == 0.40802245804924103


def test_a_law_and_a_driver_of_ones_own_are_compared():
    example = runpy.run_path(str(EXAMPLES / "compare_own.py"))
    found = example["compared"]()
    peaks_m = {(drive["law"], drive["driver"]): drive["peak_lateral_error_m"] for drive in found.drives}
    assert set(peaks_m) == {(law, driver) for law in ("paper", "spring") for driver in ("paper", "intermittent")}
    assert all(0 < peak_m < 1 for peak_m in peaks_m.values()), peaks_m
    assert [law["source"] for law in found.results["laws"]] == ["Wang et al. 2022, (9), table 8", "Python"]
    assert found.results["laws"][1]["values"] == [["stiffness_nm_per_rad", 3.0]]
    assert all(drive["worst_peak_after_loss_m"] > 0 for drive in found.drives)
    # A driver of one's own has the remnant that the scenario asks for.
    compared = example["compared"]
    compared.__globals__["FILE"] = example["FILE"].replace("remnant_sd_nm = 0.1", "remnant_sd_nm = 0")
    quiet_m = {(drive["law"], drive["driver"]): drive["peak_lateral_error_m"] for drive in compared().drives}
    assert all(quiet_m[pair] != peak_m for pair, peak_m in peaks_m.items())
    # The paper's law written in Python is the paper's law: the same torque asked for, to the last bit.
    class Paper:
        def ask(self, view):
            terms = (2.0 * view.e_y_m, 0.05 * view.e_y_rate_m_per_s, 40.0 * view.e_theta_rad)
            return 0.25 * (terms[0] + terms[1] + terms[2] + 1.0 * view.e_theta_rate_rad_per_s)

    text = example["FILE"].replace('kind = "spring", stiffness_nm_per_rad = 3', 'kind = "mine"')
    compared.__globals__["FILE"] = text.replace(', { kind = "intermittent" }', "")
    compared.__globals__["Spring"] = Paper
    with pytest.raises(hg.InputError, match='law.kind: there is no "mine", only none'):
        compared()
    compared.__globals__["FILE"] = compared.__globals__["FILE"].replace('"mine"', '"spring"')
    rows = [{**drive, "law": ""} for drive in compared().drives]
    assert rows[0] == rows[1]


def test_what_a_law_raises_ends_the_comparison():
    class Broken:
        def ask(self, view):
            raise ZeroDivisionError("at once")

    compared = runpy.run_path(str(EXAMPLES / "compare_own.py"))["compared"]
    compared.__globals__["Spring"] = Broken
    compared.__globals__["FILE"] = compared.__globals__["FILE"].replace(", stiffness_nm_per_rad = 3", "")
    with pytest.raises(ZeroDivisionError, match="at once"):
        compared()


@pytest.mark.parametrize("vehicle", ["SingleTrack", "MultiBody"])
def test_a_plant_of_ones_own(vehicle):
    pytest.importorskip("vehiclemodels")
    example = runpy.run_path(str(EXAMPLES / "own_plant.py"))
    results = {guided: example["drive"](guided, example[vehicle], 20.0) for guided in (False, True)}
    for guided, (error_m, faults, mode) in results.items():
        print(guided, np.abs(error_m).max(), faults, mode)
        assert mode == ("Active" if guided else "Standby")
        # A driver model without noise holds the wheel quite still in a steady bend: to the ECU as good as no hand, which it
        # warns of before it would fade (docs/explanation/behaviour.md).
        faults.pop("HandsOff", None)
        # Before the first frames have come, every input is silent: those are no false faults.
        assert all(time_s < 0.6 for time_s in faults.values()), faults
    assert np.abs(results[True][0]).max() < np.abs(results[False][0]).max()


@pytest.mark.parametrize("model", ["st", "mb"])
def test_a_known_driver_on_a_vehicle_that_is_not_ours(model):
    pytest.importorskip("vehiclemodels")
    example = runpy.run_path(str(EXAMPLES / "identify_commonroad.py"))
    fit = example["identified"](example["drive"](example["Vehicle"](model), 60.0, 1))
    assert fit.refuted == []
    for name, truth in example["truths"]().items():
        low, high = fit[name].interval_95
        assert low <= truth <= high, (name, truth, low, high)
    assert fit["k_hg"].identified


def test_the_agent(capsys):
    pytest.importorskip("gymnasium")
    runpy.run_path(str(EXAMPLES / "train_an_agent.py"))
    printed = capsys.readouterr().out.splitlines()
    returns = [float(line.split("return ")[1]) for line in printed]
    assert len(returns) == 11 and all(value < 0 for value in returns)


@pytest.mark.parametrize(("name", "figures"), [("figures_8_and_9", 2), ("identify_a_drive", 2), ("your_own_plant", 1)])
def test_a_notebook(name, figures):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    folder = ROOT / "examples" / "notebooks"
    notebook = nbformat.read(folder / f"{name}.ipynb", as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    for cell in cells:
        assert cell.outputs == [] and cell.execution_count is None, "it is kept without outputs"
    options = dict(timeout=1800, startup_timeout=600, kernel_name="python3")
    nbclient.NotebookClient(notebook, resources={"metadata": {"path": folder}}, **options).execute()
    outputs = [output for cell in cells for output in cell.outputs]
    assert all(cell.execution_count for cell in cells)
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) >= figures
    assert not any("OUTSIDE" in output.get("text", "") for output in outputs)


def test_the_readme(tmp_path, monkeypatch):
    text = (ROOT / "bindings" / "python" / "README.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, re.S)
    assert blocks
    monkeypatch.chdir(ROOT)
    # A sweep of another commit is not gone on with, and an earlier test run may have left one.
    shutil.rmtree(ROOT / "target" / "readme-sweep", ignore_errors=True)
    names = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
