"""`regolithd prove`: tables on the terminal, figures in a file, resumption."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

SILENT = "import json, sys; json.dump({'verdict': 'consistent', 'effects': []}, open(sys.argv[1], 'w'))"


def prove(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run the command on four short recordings, with a solver that never finds anything."""
    solver = folder / "silent.py"
    solver.write_text(SILENT)
    command = [sys.executable, "-m", "regolithd", "prove", "--recordings", "4", "--duration", "100", "--no-baselines"]
    command += ["--solver", f"{sys.executable} {solver} {{answer}}", "--out", str(folder / "batch"), *options]
    environment = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1"}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def test_consistent_is_right_on_nothing_only(tmp_path: Path) -> None:
    """A solver that always answers `consistent` is right on nothing, and on no other group."""
    figures = tmp_path / "prove.json"
    done = prove(tmp_path, "--seed", "3", "--figures", str(figures))
    assert done.returncode == 0, done.stderr
    assert "4 recordings, commitments opened" in done.stdout
    score = json.loads(figures.read_text())
    assert score["false_name_on_nothing"] == 0
    assert score["exact_set_nothing"] == 1
    assert score["exact_set_single"] == 0
    assert score["onset_within_tenth"] is None
    assert all(value is None or isinstance(value, int | float) for value in score.values())
    again = prove(tmp_path, "--seed", "3", "--figures", str(figures))
    assert again.returncode == 0
    assert len((tmp_path / "batch/commitments.csv").read_text().splitlines()) == 4


def test_another_seed_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    """A folder with the answers to another seed's recordings is an error."""
    assert prove(tmp_path, "--seed", "3").returncode == 0
    other = prove(tmp_path, "--seed", "4")
    assert other.returncode == 1
    assert "another seed" in " ".join(other.stdout.split())
