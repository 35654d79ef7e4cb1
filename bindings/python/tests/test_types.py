"""What an editor and a type checker see: the stubs against the module itself, and mypy on a small client."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import haptic_guidance as hg

STUBS = ast.parse(Path(hg.__file__).with_name("_native.pyi").read_text())


def fields(name):
    """The names and types of a TypedDict of the stubs."""
    (found,) = [node for node in STUBS.body if isinstance(node, ast.ClassDef) and node.name == name]
    return {item.target.id: item.annotation for item in found.body}


def spelling(field):
    """A field may be written with and without capitals and underscores."""
    return field.lower().replace("_", "")


def known(given):
    """The fields that the simulator names when it refuses one."""
    with pytest.raises(hg.UnknownNameError) as caught:
        hg.Scenario.from_dict(given)
    return {spelling(name) for name in str(caught.value).split("There are ")[1].split(", ")}


def test_the_version_is_that_of_the_workspace():
    cargo = Path(__file__).parents[3] / "Cargo.toml"
    version = next(line.split('"')[1] for line in cargo.read_text().splitlines() if line.startswith("version = "))
    assert hg.__version__ == version


def test_the_keywords_of_the_stubs_are_the_fields_of_a_scenario():
    top = fields("ScenarioFields")
    assert {spelling(name) for name in top} == known({"no_such": 1})
    tables = 0
    for name, annotation in top.items():
        (table,) = re.findall(r"\w+Table", ast.unparse(annotation)) or [None]
        if table not in (None, "CourseTable"):
            assert {spelling(field) for field in fields(table)} == known({name: {"no_such": 1}}), name
            tables += 1
    assert tables == 11


@pytest.mark.parametrize(
    ("table", "field"), [(None, "condition"), (None, "sensors"), ("world", "tyres"), ("failure", "kind")]
)
def test_the_words_of_the_stubs_are_those_of_a_field(table, field):
    of = fields("ScenarioFields" if table is None else f"{table.title()}Table")[field]
    given = {field: "no_such"} if table is None else {table: {field: "no_such"}}
    assert {spelling(word) for word in re.findall("'(.*?)'", ast.unparse(of))} == known(given)


def test_the_stubs_have_what_the_module_has(tmp_path):
    pytest.importorskip("mypy")
    # Nothing is missing, and every signature is that of the module.
    allowed = tmp_path / "allowed"
    allowed.write_text(r".*\.__\w+__|.*\._of|.*\.\w+Table|.*\.ScenarioFields" + "\n")
    command = [sys.executable, "-m", "mypy.stubtest", "haptic_guidance._native", "--allowlist", str(allowed)]
    checked = subprocess.run(command, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout + checked.stderr


CLIENT = """
import numpy as np
import haptic_guidance as hg

scenario = hg.Scenario(speed_m_per_s=20, condition="high", driver={"t_p_s": 0.3, "k_hg": 0.4}, failure={"kind": "torque", "time_s": 20})
road = hg.Scenario(course={"segment": [{"length_m": 300.0}]}, speed={"time_s": [0, 10], "speed_m_per_s": [16.7, 13.9]}, tolerances={"car": 3})
run: hg.Run = hg.simulate(scenario.replace(sensors="exact", guidance={"probe": True}))
errors: np.ndarray = run["lateral_error_m"]
fit: hg.Fit = hg.identify(run, also=[run, "drive.csv"], max_gap=0.1, preprocessing=False, lane_smoothing=False)
outcome = hg.Simulation(scenario).step(hg.Action(hand_torque_nm=0.5), steps=10)
if outcome is not None:
    torque: float = outcome.driver_torque_nm
frame: hg.Frame = hg.Bus().lane_preview(0.0, 0.0, age_us=100_000)
"""
# Each line is wrong, and the word is in what the checker says of it.
WRONG = """
hg.Scenario(sped=60)  # sped
hg.Scenario(condition="hihg")  # condition
hg.Scenario(driver={"t_pp": 0.3})  # t_pp
hg.Scenario(world={"tyres": "round"})  # tyres
hg.Scenario(driver={"t_p_s": "slow"})  # t_p
hg.Scenario(course={"segment": [{"curvature_per_m": 0.1}]})  # course
scenario.replace(seed="x")  # seed
hg.identify(run, maxgap=0.1)  # maxgap
hg.identify(run, also=3)  # also
hg.Ecu().step(t=0)  # t
"""


def test_mypy_passes_a_client_and_sees_each_wrong_keyword(tmp_path):
    pytest.importorskip("mypy")
    from mypy import api

    client = tmp_path / "client.py"
    client.write_text(CLIENT + WRONG.strip() + "\n")
    said, failed, _ = api.run(["--strict", "--no-error-summary", "--hide-error-context", "--cache-dir", str(tmp_path), str(client)])
    assert not failed, failed
    errors = {int(number): text for number, text in re.findall(r"client.py:(\d+): error: (.*)", said)}
    lines = client.read_text().splitlines()
    wrong = {number: line.split("# ")[1] for number, line in enumerate(lines, 1) if "# " in line}
    assert set(errors) == set(wrong), said
    for number, word in wrong.items():
        assert word in errors[number], said
