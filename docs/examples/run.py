"""Run the worked examples on the published recordings, and write what came out as one flat JSON object.

    python docs/examples/run.py FOLDER_OF_RECORDINGS FIGURES.json [REPORTS [NAME …]]

`docs/examples/README.md` says where each recording comes from. What is not in the folder is said and left out. The
comparison goes through `regolithd mismatch`, as a user would run it. The corrected simulation and other methods
(`peers.py`) are then measured on a part of the recording that neither has seen. Beside FIGURES.json there is a table,
FIGURES.md.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from peers import METHODS, predicted_residual
from published import EXAMPLES
from scipy.optimize import least_squares

from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.changes import corrected_problem, stated_in
from regolithd.calibration.mismatch.data.recording import read_recording
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from published import Example

    from regolithd.calibration.mismatch.problem.problem import Problem

PROJECT = Path(__file__).resolve().parent.parent.parent
ROUNDS = 5
"""Times that parameters and residual are fitted in turn (a choice: a sixth changes no error by 1 %)."""
Figures = dict[str, float | int | str]


def mismatch(recording: Path, simulation: Path, report: Path) -> dict[str, Any]:
    """Run the command, write report and corrected simulation beside each other, and return the answer."""
    answer = report.with_suffix(".json")
    command = [sys.executable, "-m", "regolithd", "mismatch", str(recording), "--simulation", str(simulation)]
    outputs = ["--json", str(answer), "--report", str(report), "--corrected", str(report.with_suffix(".toml"))]
    subprocess.run([*command, *outputs], cwd=PROJECT, check=True, stdout=subprocess.DEVNULL)  # noqa: S603  # our own
    found: dict[str, Any] = json.loads(answer.read_text())
    return found


def problem_of(recording: Path, simulation: Path) -> Problem:
    """Return the recording with the simulation's prediction of it, effects included."""
    model = load_simulation(simulation)
    read = read_recording(recording, unit=model.wheel_column)
    stated = stated_in(model.candidates(library()), model.corrected_effects, model.stated_effects())
    return corrected_problem(build_problem(read, model), stated)


def calibrated(problem: Problem, added: NDArray[np.float64] | float = 0.0) -> dict[str, float]:
    """Return the parameters that fit best beside `added` (rows that are compared), held by their priors."""
    priors = {name: prior for name, prior in problem.simulation.parameters.items() if prior.std > 0}
    scale = float(np.std((problem.measured - problem.filled)[problem.mask])) or 1.0

    def misfit(values: NDArray[np.float64]) -> NDArray[np.float64]:
        moved = problem.changed(**{name: float(v) for name, v in zip(priors, values, strict=True)})
        held = [(v - prior.value) / prior.std for v, prior in zip(values, priors.values(), strict=True)]
        return np.concatenate([((problem.measured - moved)[problem.mask] - added) / scale, held])

    start = [prior.value for prior in priors.values()]
    if not start:
        return {}
    found = least_squares(misfit, start, x_scale=[prior.std for prior in priors.values()])
    return {name: float(value) for name, value in zip(priors, found.x, strict=True)}


def features(problem: Problem) -> NDArray[np.float64]:
    """Return what other methods are given, shape (rows, features).

    The simulation's own covariates but time, direction and acceleration; where there are several wheels, which one.
    """
    own = set(problem.simulation.covariates(complete_inputs(problem.recording))) - {"time"}
    given = own | {"direction", "wheel_acceleration"}
    kept = [values for name, values in sorted(problem.covariates.items()) if name in given]
    wheels = len(problem.recording.wheels)
    if wheels > 1:
        kept.append(np.broadcast_to(np.arange(wheels, dtype=float), problem.mask.shape))
    return np.nan_to_num(np.stack([values[problem.mask] for values in kept], axis=1))


def named(answer: dict[str, Any]) -> str:
    """Return what the answer says in a few words: effects and wheels, and what stays unexplained."""
    found = [
        e["name"] + (f" on {','.join(map(str, e['wheels']))}" if e["wheels"] != [1] else "") for e in answer["effects"]
    ]
    return "; ".join([*found, *(f"unexplained: {place['covariate']}" for place in answer["unexplained"])])


def run(example: Example, file: Path, reports: Path) -> Figures:
    """Run one example; return its figures."""
    with tempfile.TemporaryDirectory() as folder:
        compared, unseen = example.parts(file, Path(folder))
        report = reports / f"{example.name}.html"
        answer = mismatch(compared, example.simulation, report)
        found: Figures = {
            "stated": example.stated,
            "verdict": answer["verdict"],
            "named": named(answer),
            **{f"held_out_rmse_{when}": answer["fit"][f"held_out_rmse_{when}"] for when in ("before", "after")},
        }
        for effect in answer["effects"]:
            for name, value in effect["parameters"].items():
                found[f"{effect['name']}.{name}"] = (
                    f"{value['value']:.4g} [{value['low']:.4g}, {value['high']:.4g}] {value['unit']}"
                )
        first, corrected = problem_of(compared, example.simulation), problem_of(unseen, report.with_suffix(".toml"))
        found |= unseen_errors(first, problem_of(unseen, example.simulation), corrected)
    return {f"{example.name}_{name}": value for name, value in found.items()}


def unseen_errors(seen: Problem, unseen: Problem, corrected: Problem) -> Figures:
    """Return error and R² on the unseen part: of the calibrated and the corrected simulation, and of other methods."""
    mask = unseen.mask & corrected.mask
    measured = unseen.measured[mask]
    predictions = {"calibrated": unseen.changed(**calibrated(seen))[mask], "corrected": corrected.prediction[mask]}
    predictions |= {method: with_method(method, seen, unseen, mask) for method in METHODS}
    found: Figures = {}
    for name, predicted in predictions.items():
        if isinstance(predicted, str):
            found[f"unseen {name}"] = predicted
            continue
        error = float(np.mean((measured - predicted) ** 2))
        found |= {f"unseen_rmse {name}": error**0.5, f"unseen_r2 {name}": 1 - error / float(np.var(measured))}
    return found


def with_method(method: str, seen: Problem, unseen: Problem, mask: NDArray[np.bool_]) -> NDArray[np.float64] | str:
    """Return the simulation with a method's model of its residual, on the unseen part, or why there is none.

    Parameters and residual are fitted in turn (backfitting), so that neither keeps what belongs to the other.
    """
    rows, asked = features(seen), np.concatenate([features(seen), features(unseen)[mask[unseen.mask]]])
    values = calibrated(seen)
    for _ in range(ROUNDS):
        residual = (seen.measured - seen.changed(**values))[seen.mask]
        added = predicted_residual(method, (rows, residual), asked)
        if isinstance(added, str):
            return added
        values = calibrated(seen, added[: len(rows)])
    return unseen.changed(**values)[mask] + added[len(rows) :]


COLUMNS = ("calibrated", "corrected", *METHODS)
"""Columns of the table of R² on unseen data."""


def table(found: Figures) -> str:
    """Return the figures as a Markdown table, a row for each example."""
    lines = [
        f"| recording | its literature states | answer | {' | '.join(COLUMNS)} |",
        f"|{'---|' * (3 + len(COLUMNS))}",
    ]
    for example in EXAMPLES:
        if f"{example.name}_verdict" not in found:
            continue
        scores = [found.get(f"{example.name}_unseen_r2 {column}") for column in COLUMNS]
        cells = [f"{score:.3f}".replace("-", "−") if isinstance(score, float) else "–" for score in scores]
        answer = str(found[f"{example.name}_named"]) or str(found[f"{example.name}_verdict"])
        lines.append(f"| {example.name.replace('_', ' ')} | {example.stated} | {answer} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main(recordings: Path, figures: Path, reports: Path, names: tuple[str, ...] = ()) -> None:
    """Run the examples whose recordings are there."""
    reports.mkdir(parents=True, exist_ok=True)
    figures.parent.mkdir(parents=True, exist_ok=True)
    found: Figures = {}
    for example in EXAMPLES:
        if names and example.name not in names:
            continue
        file = recordings / example.file
        if not file.is_file():
            place = f"docs/examples/{example.folder}/README.md"
            print(f"{example.name}: {file} is not there; {place} says where it comes from")  # noqa: T201
            continue
        one = run(example, file, reports)
        for name, value in one.items():
            print(f"{name:56} {value:.4g}" if isinstance(value, float) else f"{name:56} {value}", flush=True)  # noqa: T201
        found |= one
    figures.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n")
    figures.with_suffix(".md").write_text(table(found))


if __name__ == "__main__":
    if len(sys.argv) > 3:
        main(Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]), tuple(sys.argv[4:]))
    else:
        with tempfile.TemporaryDirectory() as scratch:
            main(Path(sys.argv[1]), Path(sys.argv[2]), Path(scratch))
