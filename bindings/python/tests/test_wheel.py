"""What is installed: small, typed, and without what does not belong into somebody else's process."""

import importlib.metadata
import subprocess
import sysconfig
from pathlib import Path

import pytest

import haptic_guidance as hg

# Names of crates stand in the paths of the source lines that a panic would print.
NOT_LINKED = (b"haptic-campaign", b"host-sim/campaign", b"host-sim/pil", b"host-sim/report", b"serialport", b"kuva", b"plotters", b"resvg")


def installed():
    return [Path(file.locate()) for file in importlib.metadata.files("haptic-guidance")]


def test_the_package_is_typed_and_small():
    files = installed()
    names = {file.name for file in files}
    assert {"py.typed", "_native.pyi", "__init__.py", "envs.py"} <= names
    mine = [file for file in files if "__pycache__" not in file.parts]
    # The program beside the package has what the package must not have.
    assert sum(file.stat().st_size for file in mine if file.stem != "host-sim") < 20e6
    assert sum(file.stat().st_size for file in mine if file.stem == "host-sim") < 45e6


def test_no_injector_no_serial_port_no_charts():
    libraries = [file for file in installed() if file.suffix == ".so" or ".so." in file.name]
    assert len(libraries) == 1, "one native library"
    library = libraries[0].read_bytes()
    # The crates that are linked show that a linked one would be seen.
    for there in (b"host-sim/sim/src", b"host-sim/analysis/src", b"pyo3"):
        assert there in library, there
    for name in NOT_LINKED:
        assert name not in library, name
    assert not hasattr(hg._native, "inject")


def test_the_command_line_is_a_program_of_the_environment():
    program = Path(sysconfig.get_path("scripts")) / f"host-sim{sysconfig.get_config_var('EXE')}"
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True, env={}).stdout
    assert said.split() == ["host-sim", importlib.metadata.version("haptic-guidance")]


def test_gymnasium_and_the_rest_are_optional():
    wanted = importlib.metadata.requires("haptic-guidance")
    needed = [line for line in wanted if "extra ==" not in line]
    assert [line.split(">")[0] for line in needed] == ["numpy"]
    extras = set(importlib.metadata.metadata("haptic-guidance").get_all("Provides-Extra"))
    assert {"gym", "progress", "plot", "pandas", "arrow"} <= extras


def test_the_version_is_that_of_the_module():
    assert importlib.metadata.version("haptic-guidance") == hg.__version__
