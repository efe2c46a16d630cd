"""The closed-loop study (`regolithd loop --short`): the hidden effect is found and the estimates improve."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.timeout(600)
def test_a_hidden_friction_is_found_and_corrected(tmp_path: Path) -> None:
    """Constant friction is named and written into rover.toml, and halves the cohesion error on other soils."""
    command = [sys.executable, "-m", "regolithd", "loop", "--short", "--case", "coulomb", "--seed", "5"]
    figures = tmp_path / "loop.json"
    done = subprocess.run(
        [*command, "--out", tmp_path / "loop", "--figures", figures],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(figures.read_text())
    assert found["coulomb_named"] == "coulomb-friction"
    assert found["coulomb_corrected_simulation_verdict"] == "consistent"
    hidden = found["coulomb_hidden_no_load_current_A"]
    assert found["coulomb_found_no_load_current_A"] == pytest.approx(hidden, rel=0.15)
    rover = tomllib.loads((tmp_path / "loop/coulomb/rover.toml").read_text())
    assert rover["drivetrain"]["no_load_current_A"] == pytest.approx(found["coulomb_found_no_load_current_A"])
    before, after = (found[f"coulomb_{when}_posterior_rmse_cohesion_kPa"] for when in ("before", "after"))
    assert after < 0.5 * before
    assert (tmp_path / "loop/loop.svg").stat().st_size > 10_000
    assert "Hidden" in done.stdout
