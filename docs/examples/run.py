"""Run the worked examples on the original recordings, and write what came out as one flat JSON object.

    python docs/examples/run.py FOLDER_OF_RECORDINGS FIGURES.json [REPORTS]

The folder holds `emps/`, `borealtc/` and `cmu-single-wheel/`; each example's page says where they come from. Everything
goes through `regolithd mismatch`, as a user would do it.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from regolithd.calibration.mismatch.data.recording import read_recording
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.simulation.load import load_simulation

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parent.parent
Figures = dict[str, float | int | str]


def mismatch(recording: Path, simulation: Path, report: Path) -> dict[str, Any]:
    """Run the command and return its answer."""
    answer = report.with_suffix(".json")
    command = [sys.executable, "-m", "regolithd", "mismatch", str(recording), "--simulation", str(simulation)]
    subprocess.run(  # noqa: S603  # our own command
        [*command, "--json", str(answer), "--report", str(report)], cwd=PROJECT, check=True, stdout=subprocess.DEVNULL
    )
    return json.loads(answer.read_text())


def r_squared(recording: Path, simulation: Path, answer: dict[str, Any]) -> dict[str, float]:
    """Return the held-out R² before and after: 1 − error² over the variance of what was compared."""
    model = load_simulation(tomllib.loads(simulation.read_text()), beside=simulation.parent)
    problem = build_problem(read_recording(recording, unit=model.wheel_column), model)
    variance = float(np.var(problem.measured[problem.mask]))
    return {when: 1 - answer["fit"][f"held_out_rmse_{when}"] ** 2 / variance for when in ("before", "after")}


def named(answer: dict[str, Any]) -> str:
    """Return the effects and their wheels."""
    return "; ".join(f"{e['name']} on {','.join(map(str, e['wheels']))}" for e in answer["effects"])


def emps(recordings: Path, reports: Path) -> Figures:
    """Run the servo axis: from mass × acceleration to friction."""
    recording, simulation = recordings / "emps/train.csv.gz", HERE / "emps/SIM.toml"
    answer = mismatch(recording, simulation, reports / "emps.html")
    explained = r_squared(recording, simulation, answer)
    values = {e["name"]: e["parameters"] for e in answer["effects"]}
    found: Figures = {"emps_named": named(answer), "emps_verdict": answer["verdict"]}
    found |= {f"emps_held_out_r2_{when}": value for when, value in explained.items()}
    for name, key in (
        ("coulomb-friction", "coulomb_current"),
        ("viscous-friction", "viscous_coefficient"),
        ("asymmetric-friction", "half_difference"),
    ):
        if name in values:
            found[f"emps_{name.replace('-', '_')}"] = values[name][key]["value"]
    return found


def husky(recordings: Path, reports: Path) -> Figures:
    """Run the skid-steer robot on two grounds, whole runs held out."""
    found: Figures = {}
    for terrain in ("ASPHALT", "FLOORING"):
        recording = reports / f"{terrain.lower()}.csv"
        log = recordings / "borealtc/asphalt-and-flooring.csv.gz"
        subprocess.run(  # noqa: S603  # our own script
            [sys.executable, str(HERE / "husky/convert.py"), str(log), terrain, str(recording)], check=True
        )
        answer = mismatch(recording, HERE / "husky/SIM.toml", reports / f"husky-{terrain.lower()}.html")
        names = {effect["name"]: effect for effect in answer["effects"]}
        turning = names.get("turning-resistance", {"wheels": []})
        key = f"husky_{terrain.lower()}"
        found |= {
            f"{key}_named": named(answer),
            f"{key}_turning_on_both_sides": int(turning["wheels"] == [1, 2]),
            f"{key}_slope_claimed": int("grade-resistance" in names),
            f"{key}_acceleration_claimed": int("rotor-inertia" in names),
            f"{key}_held_out_rmse_before_A": answer["fit"]["held_out_rmse_before"],
            f"{key}_held_out_rmse_after_A": answer["fit"]["held_out_rmse_after"],
        }
    return found


def cmu_wheel(recordings: Path, reports: Path) -> Figures:
    """Run the single wheel, slip angles held out."""
    recording, simulation = reports / "cmu.csv", HERE / "cmu_wheel/SIM.toml"
    trials = recordings / "cmu-single-wheel/smooth.csv"
    convert = str(HERE / "cmu_wheel/convert.py")
    subprocess.run([sys.executable, convert, str(trials), str(recording)], check=True)  # noqa: S603  # our own script
    answer = mismatch(recording, simulation, reports / "cmu-wheel.html")
    explained = r_squared(recording, simulation, answer)
    lateral = [e["name"] for e in answer["effects"] if e["wheels"] == [2]]
    return {
        "cmu_wheel_named": named(answer),
        "cmu_wheel_named_across": ", ".join(lateral),
        **{f"cmu_wheel_held_out_r2_{when}": value for when, value in explained.items()},
    }


def main(recordings: Path, figures: Path, reports: Path) -> None:
    """Run the three examples."""
    reports.mkdir(parents=True, exist_ok=True)
    found = emps(recordings, reports) | husky(recordings, reports) | cmu_wheel(recordings, reports)
    figures.parent.mkdir(parents=True, exist_ok=True)
    figures.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n")
    for name, value in found.items():
        print(f"{name:44} {value:.4g}" if isinstance(value, float) else f"{name:44} {value}")  # noqa: T201  # a script


if __name__ == "__main__":
    if len(sys.argv) > 3:
        main(Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        with tempfile.TemporaryDirectory() as scratch:
            main(Path(sys.argv[1]), Path(sys.argv[2]), Path(scratch))
