"""The solver of the study: `regolithd mismatch`, and how well each effect alone explains the recording.

python -m regolithd.calibration.validation.experiment_study.solver answer|names FOLDER [FOLDER …]

Each folder has recording.csv.gz and SIM.toml, and gets answer.json. With `names` only the search for names is done: the
answer has the names alone, before they are tested on held-out blocks, in a third of the time.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.calibration.linearised import linearised_where_it_fits
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.comparison import decided
from regolithd.calibration.mismatch.data.recording import read_recording
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.regression.equations import with_library
from regolithd.calibration.mismatch.selection.best_subsets import acceptable, best_of_each_candidate
from regolithd.calibration.mismatch.selection.decision import Decision, decide
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.simulation.simulation import Simulation


def scores_of(decision: Decision) -> dict[str, float]:
    """Return the evidence for each effect alone that is acceptable: its Δχ² in its best shape less its penalty."""
    equations = decision.equations
    best = best_of_each_candidate(equations, ())
    return {term.name: score for score, term in best if acceptable(equations, equations.fit((term,)))}


def answered(recording: Recording, simulation: Simulation) -> dict[str, Any]:
    """Return the answer of `regolithd mismatch`, without scores."""
    return {"answer": decided(recording, simulation, effects=()).told(simulation).to_json(), "scores": {}}


def named(recording: Recording, simulation: Simulation) -> dict[str, Any]:
    """Return the names that the search decides on, and the scores."""
    candidates = [each.form_for(simulation) for each in simulation.candidates(library())]
    equations = linearised_where_it_fits(lambda values: build_problem(recording, simulation, values))
    decision = decide(*with_library(equations, candidates))
    effects = [{"name": term.name} for term in decision.named.terms]
    return {"answer": {"effects": effects}, "scores": scores_of(decision)}


def main() -> None:
    """Solve each folder."""
    how, *folders = sys.argv[1:]
    solve = {"answer": answered, "names": named}[how]
    for folder in map(Path, folders):
        simulation = load_simulation(folder / "SIM.toml")
        recording = read_recording(folder / "recording.csv.gz", unit=simulation.wheel_column)
        (folder / "answer.json").write_text(json.dumps(solve(recording, simulation)) + "\n")


if __name__ == "__main__":
    main()
