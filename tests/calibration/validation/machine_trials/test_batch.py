"""A batch as a person runs it: sealed before the solver starts, scored after it, and resumed where it stopped."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING

from regolithd.calibration.validation.blind_trials.commitment import read_opened
from regolithd.calibration.validation.machine_trials.batch import Batch, run_case
from regolithd.calibration.validation.machine_trials.cases.plan import plan_case

if TYPE_CHECKING:
    from pathlib import Path

SILENT = "import json, sys; json.dump({'verdict': 'consistent', 'effects': []}, open(sys.argv[1], 'w'))"
CORRECTS = """
import json, pathlib, shutil, sys
recording, simulation, answer, *more = sys.argv[1:]
if more:
    shutil.copy(simulation, more[1])
seen = sorted(path.name for path in pathlib.Path(".").iterdir())
pathlib.Path(answer).write_text(json.dumps({"verdict": "consistent", "effects": [], "seen": seen, "of": recording}))
"""


def prove(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run the command on propeller cases, with a solver that never finds anything."""
    solver = folder / "silent.py"
    solver.write_text(SILENT)
    command = [sys.executable, "-m", "regolithd.calibration.validation.machine_trials", "--machine", "propeller-stand"]
    command += ["--solver", f"{sys.executable} {solver} {{answer}}", "--out", str(folder / "batch"), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_silence_is_right_where_nothing_is_and_grave_elsewhere(tmp_path: Path) -> None:
    """A tool that always says `consistent` is right on nothing, and commits the gravest error on an effect."""
    figures = tmp_path / "score.json"
    done = prove(tmp_path, "--cases", "3", "--seed", "3", "--figures", str(figures))
    assert done.returncode == 0, done.stderr
    score = json.loads(figures.read_text())
    assert score["cases"] == 3
    assert score["propeller_stand_nothing_right"] == 1
    assert score["propeller_stand_single_right"] == 0
    assert score["consistent_over_effect"] >= 1
    assert all(value is None or isinstance(value, int | float) for value in score.values())
    assert "GRAVE" in done.stdout
    again = prove(tmp_path, "--cases", "3", "--seed", "3", "--figures", str(figures))
    assert again.returncode == 0
    assert len((tmp_path / "batch/commitments.csv").read_text().splitlines()) == 3
    other = prove(tmp_path, "--cases", "3", "--seed", "4", "--figures", str(figures))
    # Messages are wrapped to the width of the terminal.
    assert (other.returncode, "another seed" in " ".join(other.stdout.split())) == (1, True)


def test_the_truth_is_committed_to_and_its_files_bound(tmp_path: Path) -> None:
    """The opened truth has the digest that was written before, and tells the files but no seed."""
    batch = Batch(tmp_path, (), f"{sys.executable} -c pass", keep=True)
    outcome = run_case(batch, plan_case(4, 3, "propeller-stand", "single", 0))
    (line,) = (tmp_path / "commitments.csv").read_text().splitlines()
    opened = json.loads((tmp_path / "opened/0004.json").read_text())
    assert line == f"4,{opened['digest']}"
    sealed = read_opened(tmp_path / "opened/0004.json")
    assert set(sealed["files_sha256"]) == {"0/SIM.toml", "0/propeller_stand.py", "0/recording.csv.gz"}
    assert "seed" not in sealed
    assert "failed" in outcome.answers[0]


def test_a_later_recording_reaches_the_solver_after_its_correction(tmp_path: Path) -> None:
    """The first answer is given without the later recording, the second with it and the corrected simulation."""
    solver = tmp_path / "corrects.py"
    solver.write_text(CORRECTS)
    command = f"{sys.executable} {solver} {{recording}} {{simulation}} {{answer}}"
    outcome = run_case(Batch(tmp_path, (), command), plan_case(0, 3, "propeller-stand", "corrected-unchanged", 0))
    assert outcome.first is not None
    assert "later.csv.gz" not in outcome.first["seen"]
    assert {"later.csv.gz", "CORRECTED.toml"} <= set(outcome.answers[0]["seen"])
    assert (outcome.first["of"], outcome.answers[0]["of"]) == ("recording.csv.gz", "later.csv.gz")


def test_a_tool_that_writes_no_corrected_simulation_gave_no_answer(tmp_path: Path) -> None:
    """Without the corrected file there is nothing to compare a later recording with, and that is counted as wrong."""
    solver = tmp_path / "silent.py"
    solver.write_text(SILENT)
    batch = Batch(tmp_path, (), f"{sys.executable} {solver} {{answer}}")
    outcome = run_case(batch, plan_case(0, 3, "propeller-stand", "corrected-gone", 0))
    assert outcome.answers == [{"failed": "no corrected simulation was written"}]
