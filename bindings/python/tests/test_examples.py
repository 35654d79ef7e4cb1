"""The examples and the lines of the README, as a reader runs them."""

import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "examples" / "python"


def test_figure_9(tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(EXAMPLES / "figure_9.py"))
    assert (tmp_path / "figure-9.png").stat().st_size > 10_000


def test_a_plant_of_ones_own():
    pytest.importorskip("vehiclemodels")
    drive = runpy.run_path(str(EXAMPLES / "own_plant.py"))["drive"]
    results = {guided: drive(guided) for guided in (False, True)}
    for guided, (error_m, faults, mode) in results.items():
        print(guided, np.abs(error_m).max(), faults, mode)
        assert mode == ("Active" if guided else "Standby")
        # A driver model without noise holds the wheel quite still in a steady bend: to the ECU as good as no hand, which it
        # warns of before it would fade (docs/safety.md).
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
