"""The worked examples: users' classes through the same engine, on recordings that others published."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from calibration.mismatch.compare import compare
from calibration.mismatch.recording import read_recording
from calibration.mismatch.simulation import load_simulation

EXAMPLES = Path(__file__).resolve().parents[3] / "docs/examples"


def answered(recording: Path, example: str) -> dict[str, tuple[int, ...]]:
    """Return which effects the engine names, and on which wheels."""
    toml = EXAMPLES / example / "SIM.toml"
    simulation = load_simulation(tomllib.loads(toml.read_text()), beside=toml.parent)
    found = compare(read_recording(recording, unit=simulation.wheel_column), simulation)
    return {effect.name: effect.wheels for effect in found.answer.effects}


def converted(example: str, *arguments: str) -> None:
    """Run an example's own conversion."""
    subprocess.run([sys.executable, str(EXAMPLES / example / "convert.py"), *arguments], check=True)


@pytest.mark.parametrize("module", sorted(EXAMPLES.glob("*/*.py")), ids=lambda path: path.name)
def test_a_user_s_class_is_short(module: Path) -> None:
    """A simulation of one's own takes under sixty lines of code; so does a family of candidates."""
    lines = [line.strip() for line in module.read_text().splitlines()]
    code = [line for line in lines if line and not line.startswith(("#", '"""', "from ", "import "))]
    assert len(code) < 60


@pytest.mark.timeout(240)
def test_servo_axis_friction_is_named(shared_folder: Path) -> None:
    """Mass × acceleration leaves out viscous and Coulomb friction."""
    found = answered(shared_folder / "recordings/emps/train.csv.gz", "emps")
    assert {"coulomb-friction", "viscous-friction"} <= set(found)


@pytest.mark.timeout(240)
def test_husky_turning_is_named_on_both_sides(shared_folder: Path, tmp_path: Path) -> None:
    """What a current from speed alone leaves out is the turning, left and right."""
    recording = tmp_path / "asphalt.csv"
    log = shared_folder / "recordings/borealtc/asphalt-and-flooring.csv.gz"
    converted("husky", str(log), "ASPHALT", str(recording))
    found = answered(recording, "husky")
    assert found.get("turning-resistance") == (1, 2)
    assert "rotor-inertia" not in found


def test_single_wheel_converts_to_two_axes_and_seven_runs(shared_folder: Path, tmp_path: Path) -> None:
    """Each trial is one instant with two forces; each slip angle a run that can be held out."""
    recording = tmp_path / "trials.csv"
    converted("cmu_wheel", str(shared_folder / "recordings/cmu-single-wheel/smooth.csv"), str(recording))
    found = read_recording(recording, unit="axis")
    assert found.wheels == (1, 2)
    assert len(set(found.run.tolist())) == 7
