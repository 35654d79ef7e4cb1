"""Laws against NumPy: the recorded drives that the simulator's FDCA is tested on have what NumPy asks for."""

import importlib.util
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[3]


def script(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / f"tests/tools/{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_recorded_drives_have_what_numpy_asks_for():
    table = np.loadtxt(ROOT / "tests/data/fdca_drives.csv", delimiter=",", skiprows=2)
    rows, asked_nm = table[:, :-1], table[:, -1]
    assert len(rows) > 2500
    assert np.abs(script("fdca").asked_nm(rows) - asked_nm).max() < 1e-8
