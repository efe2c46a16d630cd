"""The generator: independent of the solver, reproducible, with effects of the stated strength."""

from __future__ import annotations

import ast
import csv
import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from regolithd.calibration.parameters import SOILS, Wheel
from regolithd.calibration.terrain.wheel_soil import contact_angle, wheel_torque
from regolithd.calibration.validation.blind_trials import recordings
from regolithd.calibration.validation.blind_trials.recordings.files import COLUMNS, write_trial
from regolithd.calibration.validation.blind_trials.recordings.generator import (
    SHARES,
    Plan,
    Trial,
    make_trial,
    plan_batch,
)
from regolithd.calibration.validation.blind_trials.recordings.ground import (
    Ground,
    TorqueTable,
    contact,
    load_and_torque,
)
from regolithd.calibration.validation.blind_trials.recordings.library_effects import LIBRARY_EFFECTS
from regolithd.calibration.validation.blind_trials.recordings.out_of_library import OUT_OF_LIBRARY
from regolithd.calibration.validation.blind_trials.recordings.traverse import ProposedExperiment

FOLDER = Path(recordings.__file__).parent


def short(group: str, *names: str, number: int = 3) -> Trial:
    """Return a trial of five minutes."""
    return make_trial(Plan(number, 11, group, names), duration_s=300)


@pytest.mark.parametrize("file", sorted(FOLDER.glob("*.py")), ids=lambda path: path.name)
def test_the_generator_imports_nothing_of_the_solver(file: Path) -> None:
    """Of this project the generator imports only its own folder."""
    tree = ast.parse(file.read_text())
    froms = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    names = froms | {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    ours = {name for name in names if name.split(".")[0] == "regolithd"}
    assert all(name.startswith("regolithd.calibration.validation.blind_trials.recordings.") for name in ours), ours


@pytest.mark.parametrize("soil", list(SOILS))
def test_two_solutions_of_the_wheel_on_soil_agree(soil: str) -> None:
    """Quadrature and bisection give the contact angle and torque of closed forms and secant method."""
    known, wheel = SOILS[soil], Wheel()
    ground = Ground(
        known.cohesion_Pa,
        np.radians(known.friction_angle_deg),
        known.shear_modulus_m,
        1000 * (known.k_c_kN / wheel.width_m + known.k_phi_kN),
        known.sinkage_exponent,
        wheel.radius_m,
        wheel.width_m,
    )
    load, slip = np.meshgrid([20.0, 49.0, 80.0], [0.01, 0.1, 0.3])
    theirs = contact_angle(load, slip, wheel, known)
    ours = contact(ground, load, slip)
    np.testing.assert_allclose(ours, theirs, rtol=1e-9)
    torque = load_and_torque(ground, ours, slip)[1]
    np.testing.assert_allclose(torque, wheel_torque(theirs, slip, wheel, known), rtol=1e-9)
    np.testing.assert_allclose(TorqueTable(ground)(load, slip), torque, rtol=1e-4)


def test_same_plan_same_recording(tmp_path: Path) -> None:
    """Seed and number determine the recording to the byte; another number gives another."""
    first, second, other = (
        write_trial(short("single", "coulomb-friction", number=number), tmp_path / str(at))[0].read_bytes()
        for at, number in enumerate((3, 3, 4))
    )
    assert first == second
    assert first != other


def test_the_folder_has_the_two_input_files_only(tmp_path: Path) -> None:
    """The recording has one row for each instant and wheel and the documented columns; beside it is SIM.toml alone."""
    recording, _ = write_trial(short("nothing"), tmp_path)
    with gzip.open(recording, "rt") as text:
        rows = list(csv.reader(text))
    assert tuple(rows[0]) == COLUMNS
    assert [row[1] for row in rows[1:7]] == list("123456")
    assert len(rows) == 1 + 6 * 1500
    assert sorted(path.name for path in tmp_path.iterdir()) == ["SIM.toml", "recording.csv.gz"]


@pytest.mark.parametrize("name", [*LIBRARY_EFFECTS, *OUT_OF_LIBRARY])
def test_each_effect_is_concealed_at_its_strength(name: str) -> None:
    """Each effect has 5–25 % of the mean current, acts on its wheels only, and the noise is about 30 %."""
    trial = short("single", name)
    (effect,) = trial.effects
    assert 0.049 < effect.strength < 0.251
    added = effect.added_current_A(effect.size)
    untouched = [wheel - 1 for wheel in range(1, 7) if wheel not in effect.wheels]
    assert not np.any(added[:, untouched])
    assert 0.25 < trial.noise_A / trial.mean_current_A < 0.33
    assert trial.true_rmse_A == pytest.approx(trial.noise_A, rel=0.12)


def test_nothing_concealed_leaves_nothing_but_noise() -> None:
    """Without an effect the RMSE of the true model does not depend on the list of effects."""
    trial = short("nothing")
    assert trial.effects == ()
    with_effect = replace(trial, effects=())
    assert with_effect.true_rmse_A == trial.true_rmse_A


def test_an_experiment_varies_what_it_asks_for_and_keeps_the_effect() -> None:
    """The same rover with the same drag drives several speeds in both directions, on level ground as before."""
    plan = Plan(3, 11, "constant", ("coulomb-friction",))
    before, after = (
        make_trial(plan, duration_s=400, experiment=told)
        for told in (None, ProposedExperiment(frozenset({"wheel_speed", "direction"}), 0.0, lift=False))
    )
    assert before.tables == after.tables
    assert before.effects[0].size == after.effects[0].size
    assert np.ptp(before.traverse.wheel_speed_rad_s) == 0
    assert after.traverse.wheel_speed_rad_s.min() < -0.05 < 0.05 < after.traverse.wheel_speed_rad_s.max()
    assert not after.traverse.pitch_rad.any()
    assert np.ptp(after.traverse.temperature_degC[:, 0]) == 0


def test_an_experiment_lasts_as_long_as_it_asks_and_lifts_the_wheels_where_it_says_so() -> None:
    """In the last third loads and hub speeds are zero, and the current is the concealed drag alone."""
    plan = Plan(3, 11, "constant", ("coulomb-friction",))
    trial = make_trial(plan, duration_s=300, experiment=ProposedExperiment(frozenset({"direction"}), 600.0, lift=True))
    traverse = trial.traverse
    assert traverse.t_s[-1] == pytest.approx(600, abs=1)
    lifted = traverse.t_s > 2 / 3 * traverse.t_s[-1]
    assert not traverse.load_N[lifted].any()
    assert not traverse.hub_speed_m_s[lifted].any()
    assert traverse.load_N[~lifted].min() > 5
    turning = traverse.moving & lifted[:, None]
    drag = float(np.mean((trial.current_A * np.sign(traverse.wheel_speed_rad_s))[turning]))
    assert drag == pytest.approx(trial.effects[0].size, rel=0.25)


def test_a_batch_contains_every_effect() -> None:
    """Two hundred recordings contain every effect, and the groups in their shares."""
    plans = plan_batch(5, 200)
    named = {name for plan in plans for name in plan.names}
    assert named == {*LIBRARY_EFFECTS, *OUT_OF_LIBRARY}
    for group, share in SHARES.items():
        assert sum(plan.group == group for plan in plans) == round(200 * share)
    assert [plan.number for plan in plans] == list(range(200))
    assert all(len(set(plan.names)) == 2 for plan in plans if plan.group == "pair")


def test_an_answer_s_experiment_is_read_from_its_data() -> None:
    """All sets together: what each varies, the longest duration, and whether one lifts the wheels."""
    sets = [
        {"vary": ["direction"], "duration_s": 600.0, "lift": False, "experiment": "a staircase of speeds"},
        {"vary": ["torque", "time"], "duration_s": 1200.0, "lift": True, "experiment": ""},
    ]
    found = ProposedExperiment.of_answer({"indistinguishable": sets})
    assert found == ProposedExperiment(frozenset({"direction", "torque", "time"}), 1200.0, lift=True)
    assert found.conditions == {"reverse", "slope", "ballast", "lift", "speed"}
    assert ProposedExperiment(frozenset({"yaw_rate"}), 60.0, lift=False).conditions == {"turn"}
    assert ProposedExperiment.of_answer({"indistinguishable": []}) is None
