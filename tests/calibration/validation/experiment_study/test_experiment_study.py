"""The study of proposed experiments: the three choices, a trial with a solver of one line, figures and picture."""

from __future__ import annotations

import ast
import json
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.validation.blind_trials.errors import OtherBatchError, SolverError
from regolithd.calibration.validation.blind_trials.recordings.generator import Plan
from regolithd.calibration.validation.blind_trials.recordings.traverse import CONDITIONS_OF, ProposedExperiment
from regolithd.calibration.validation.experiment_study import choices, subjects
from regolithd.calibration.validation.experiment_study.__main__ import table
from regolithd.calibration.validation.experiment_study.choices import (
    CHOICES,
    COVARIATE_OF,
    experiments,
    own_covariate,
    plans,
    random_experiment,
)
from regolithd.calibration.validation.experiment_study.picture import picture
from regolithd.calibration.validation.experiment_study.score import figures_of
from regolithd.calibration.validation.experiment_study.subjects import ROVER, VEHICLE, level_drive, varied_drive
from regolithd.calibration.validation.experiment_study.trials import Result, Trial, margin_of, remaining, run_trial
from regolithd.calibration.validation.machine_trials.physics.machine import Schedule

if TYPE_CHECKING:
    from types import ModuleType

GENERATORS = ("blind_trials.recordings.", "machine_trials.", "experiment_study.subjects")
SET = {"effects": ["viscous-friction", "coulomb-friction"], "vary": ["wheel_speed"], "duration_s": 900.0, "lift": True}
UNDECIDED = {"effects": [{"name": "coulomb-friction"}], "indistinguishable": [SET]}


@pytest.mark.parametrize("module", [choices, subjects], ids=["choices", "subjects"])
def test_choices_and_recordings_import_nothing_of_the_solver(module: ModuleType) -> None:
    """Of this project they know each other and the generators of recordings alone."""
    tree = ast.parse(Path(str(module.__file__)).read_text())
    froms = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    names = froms | {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    ours = {name for name in names if name.split(".")[0] == "regolithd"}
    assert ours
    assert all(name.removeprefix("regolithd.calibration.validation.").startswith(GENERATORS) for name in ours), ours


def test_the_three_choices_come_from_the_answer_alone() -> None:
    """What it proposes; the covariate of what it names; one to three at random, the same for the same plan."""
    plan = plans(7, 3)[2]
    found = experiments(UNDECIDED, plan, ROVER)
    assert tuple(found) == CHOICES
    assert found["proposed"] == ProposedExperiment(frozenset({"wheel_speed"}), 900.0, lift=True)
    assert found["covariate-wise"] == ProposedExperiment(frozenset({"direction"}), 0.0, lift=False)
    assert found["random"] == random_experiment(plan, ROVER)
    assert own_covariate({"effects": [], "indistinguishable": [SET]}) == "wheel_speed"
    assert experiments({"effects": [], "indistinguishable": []}, plan, ROVER) == {}


def test_random_experiments_differ_and_can_be_driven() -> None:
    """Every covariate that a drive can vary occurs, and both with and without the wheels lifted."""
    found = [random_experiment(plan, ROVER) for plan in plans(1, 60)]
    assert frozenset[str]().union(*(each.vary for each in found)) == set(CONDITIONS_OF)
    assert {each.lift for each in found} == {True, False}
    assert {len(each.vary) for each in found} == {1, 2, 3}
    assert not any(random_experiment(plan, VEHICLE).lift for plan in plans(1, 20))
    assert set(COVARIATE_OF.values()) <= set(CONDITIONS_OF)


def test_the_vehicle_varies_what_is_asked_for_and_nothing_else() -> None:
    """At first one speed, payload and slope; then the speed alone, or payload and direction."""
    schedule = Schedule(2.0, 300.0)
    level = level_drive(np.random.default_rng(1), schedule)
    changing = {"motor_temperature_degC", "wheel_angle_rad", "bus_voltage_V"}
    assert {name for name, values in level.columns.items() if np.ptp(values) > 0} == changing

    def driven(*vary: str) -> set[str]:
        columns = varied_drive(np.random.default_rng(2), schedule, level, frozenset(vary)).columns
        same = {name for name, values in columns.items() if np.array_equal(values, level.columns[name])}
        return columns.keys() - same

    moving = {"wheel_speed_rad_s", "wheel_acceleration_rad_s2", "wheel_angle_rad"}
    assert driven("wheel_speed") == moving
    assert driven("torque", "direction") == {*moving, "payload_kg"}
    assert driven("temperature") - {"wheel_angle_rad"} <= {"motor_temperature_degC", *moving}
    forwards = varied_drive(np.random.default_rng(2), schedule, level, frozenset({"wheel_speed"})).columns
    assert forwards["wheel_speed_rad_s"].min() > 0
    both = varied_drive(np.random.default_rng(2), schedule, level, frozenset({"direction"})).columns
    assert both["wheel_speed_rad_s"].min() < 0


@pytest.mark.parametrize("name", choices.CONCEALED)
def test_the_vehicle_conceals_every_effect_of_the_study(name: str, tmp_path: Path) -> None:
    """The same files again for the same plan, and others for the experiment."""
    plan = Plan(3, 7, "constant", (name,))
    for folder, experiment in (("a", None), ("b", None), ("c", random_experiment(plan, VEHICLE))):
        VEHICLE.write(plan, experiment, tmp_path / folder, 120.0)
    read = [(tmp_path / folder / "recording.csv.gz").read_bytes() for folder in "abc"]
    assert read[0] == read[1]
    assert read[0] != read[2]
    assert (tmp_path / "c" / "SIM.toml").exists()


def solver(answer: object) -> str:
    """Return a command that answers this."""
    write = f"pathlib.Path(each, 'answer.json').write_text({json.dumps(answer)!r})"
    text = f"import pathlib, sys\nfor each in sys.argv[2:]: {write}"
    return shlex.join([sys.executable, "-c", text])


def test_a_trial_drives_the_three_experiments_and_is_kept(tmp_path: Path) -> None:
    """The right name alone is right; the margin is that over the best other name; a kept one is not driven again."""
    scores = {"coulomb-friction": 50.0, "viscous-friction": 12.0, "rotor-inertia": 3.0}
    command = solver({"answer": UNDECIDED, "scores": scores})
    plan = plans(7, 1)[0]
    trial = run_trial(plan, ROVER, tmp_path, command, 60.0)
    assert trial.undecided
    assert {choice: (one.right, one.margin) for choice, one in trial.results.items()} == dict.fromkeys(
        CHOICES, (True, 38.0)
    )
    assert trial.results["proposed"].varied == ("wheel_speed",)
    assert run_trial(plan, ROVER, tmp_path, "false", 60.0) == trial
    with pytest.raises(OtherBatchError):
        run_trial(plans(8, 1)[0], ROVER, tmp_path, command, 60.0)


def test_a_solver_without_an_answer_is_an_error(tmp_path: Path) -> None:
    """And one that finds nothing to tell apart leaves the trial without results."""
    with pytest.raises(SolverError):
        run_trial(plans(7, 1)[0], ROVER, tmp_path, shlex.join([sys.executable, "-c", "pass"]), 60.0)
    nothing = solver({"answer": {"effects": [], "indistinguishable": []}, "scores": {}})
    trial = run_trial(plans(7, 1)[0], ROVER, tmp_path, nothing, 60.0)
    assert (trial.undecided, trial.results) == (False, {})


def test_the_margin_of_a_name_that_explains_nothing_is_negative() -> None:
    """Another name is ahead by so much."""
    assert margin_of({"viscous-friction": 12.0}, "coulomb-friction", set()) == -12.0
    assert margin_of({"coulomb-friction": 12.0}, "coulomb-friction", set()) == 12.0


def test_what_an_experiment_did_not_test_is_not_told_apart() -> None:
    """At one temperature cold lubricant is a constant drag, if it was possible before."""
    scores = {"coulomb-friction": 30.0, "viscous-friction": 12.0}
    first = {"effects": [], "indistinguishable": [], "alternatives": [{"effects": ["cold-lubricant-friction"]}]}
    possible = remaining(first)
    assert margin_of(scores, "coulomb-friction", possible) == 0.0
    assert margin_of(scores, "cold-lubricant-friction", set()) == 0.0
    tested = {**scores, "cold-lubricant-friction": 25.0}
    assert margin_of(tested, "coulomb-friction", possible) == 5.0
    assert margin_of(tested, "coulomb-friction", possible, {"temperature"}) == 0.0
    assert margin_of({"load-dependent-efficiency": 40.0, **scores}, "load-dependent-efficiency", possible) == 10.0


def trial(number: int, proposed: float, one: float, random: float) -> Trial:
    """Return a trial with these margins, right where they are positive."""
    margins = dict(zip(CHOICES, (proposed, one, random), strict=True))
    results = {choice: Result(margin > 0, margin, ("pitch",), lift=False) for choice, margin in margins.items()}
    return Trial(number, "coulomb-friction", undecided=True, results=results)


def test_figures_count_wins_and_compare_margins() -> None:
    """Intervals contain the share and the median difference; equal margins are no win."""
    trials = [trial(k, 40.0 + k, 10.0, 20.0 if k else 40.0) for k in range(10)]
    figures = figures_of([*trials, Trial(10, "coulomb-friction", undecided=False, results={})])
    assert (figures["trials"], figures["driven"]) == (11, 10)
    assert figures["proposed_right"] == 10
    assert figures["wins_against_covariate_wise"] == 10
    assert (figures["wins_against_random"], figures["ties_with_random"]) == (9, 1)
    assert figures["win_share_against_random"] == 1.0
    assert figures["win_share_against_random_low"] == pytest.approx(0.05 ** (1 / 9), rel=1e-6)
    assert figures["proposed_margin_median"] == pytest.approx(44.5)
    assert figures["ahead_of_covariate_wise"] == pytest.approx(34.5)
    assert figures["ahead_of_covariate_wise_low"] < 34.5 < figures["ahead_of_covariate_wise_high"]
    assert table(figures).row_count == 3
    assert figures_of([]) == {"trials": 0, "driven": 0}


def test_the_picture_has_a_dot_for_each_experiment() -> None:
    """Full where the name is right, hollow where it is not."""
    drawn = picture([trial(0, 40.0, -2.0, 5.0), Trial(1, "coulomb-friction", undecided=False, results={})])
    assert drawn.count('class="right"') == 2
    assert drawn.count('class="wrong"') == 1
