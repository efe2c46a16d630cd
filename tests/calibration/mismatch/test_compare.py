"""Comparisons of short recordings: the effect that was added is named, and nothing where nothing is missing."""

from __future__ import annotations

import json
import tomllib
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from rover_drives import TABLES, columns, recording, simulation

from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.changes import corrected_problem, stated_in
from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.corrected import corrected_tables, stated_effects
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.calibration.toml_document import to_toml

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.result import Comparison


def with_drag(
    share: float, wheels: tuple[int, ...] = (1, 2, 3, 4, 5, 6), **drive: float
) -> dict[str, NDArray[np.float64]]:
    """Return a drive with Coulomb friction added, as a share of the mean current."""
    table = columns(3, **drive)
    current = table["motor_current_A"]
    on = np.isin(table["wheel"], wheels)
    table["motor_current_A"] = current + share * np.mean(np.abs(current)) * np.sign(table["motor_speed_rad_s"]) * on
    return table


@pytest.fixture(scope="module")
def coulomb() -> Comparison:
    """Return what is said of a drive with Coulomb friction of a fifth of the mean current."""
    return compare(from_columns(with_drag(0.2)), simulation())


def test_nothing_missing_is_consistent_and_says_what_that_is_worth() -> None:
    """No names, nothing unexplained, and a smallest detectable effect for every candidate."""
    answer = compare(recording(1), simulation()).answer
    assert answer.verdict == "consistent"
    assert not answer.effects
    assert not answer.unexplained
    assert len(answer.sensitivity) >= 16
    assert all(s.smallest_detectable > 0 for s in answer.sensitivity)
    assert answer.fit.held_out_rmse_after == pytest.approx(answer.fit.noise_floor_rmse, rel=0.02)


def test_coulomb_friction_is_named_measured_and_pays(coulomb: Comparison) -> None:
    """Name, wheels, size within its bounds, and a held-out error at the noise floor."""
    (effect,) = coulomb.answer.effects
    assert effect.name == "coulomb-friction"
    assert effect.wheels == (1, 2, 3, 4, 5, 6)
    size = effect.parameters["coulomb_current"]
    assert size.low < size.value < size.high
    assert effect.rmse_after < effect.rmse_before
    assert coulomb.answer.fit.held_out_rmse_after < 1.02 * coulomb.answer.fit.noise_floor_rmse


def test_the_same_input_has_the_same_answer(coulomb: Comparison) -> None:
    """To the last digit of the JSON, whatever the order of the rows."""
    table = with_drag(0.2)
    order = np.random.default_rng(0).permutation(len(table["t_s"]))
    again = compare(from_columns({name: values[order] for name, values in table.items()}), simulation())
    one, other = (json.dumps(c.answer.to_json() | {"notes": []}) for c in (coulomb, again))
    assert one == other


def test_effects_of_other_kinds_are_read_again_too(coulomb: Comparison) -> None:
    """One wheel's drag from some time on has no table in the daemon: it stands in `[[effects]]`."""
    drag = Contribution("bearing-drag", {"onset_s": 100.0, "rise_s": 30.0}, (0.004,), (3,))
    tables = tomllib.loads(to_toml(corrected_tables(TABLES, simulation(), coulomb.evidence.values, (drag,))))
    assert stated_effects(tables) == (drag,)
    problem = build_problem(recording(3), simulation())
    added = corrected_problem(problem, stated_in(library(), stated_effects(tables), ())).added
    assert added[problem.time_s[:, 0] < 100].max() == 0
    assert np.abs(added[:, 2]).max() == pytest.approx(0.004, rel=0.01)
    assert np.abs(np.delete(added, 2, axis=1)).max() == 0


def test_the_corrected_simulation_is_consistent_with_the_recording(coulomb: Comparison) -> None:
    """What `--corrected` writes is read again, has the drag in the daemon's table, and leaves nothing."""
    sim = simulation()
    text = to_toml(corrected_tables(TABLES, sim, coulomb.evidence.values, coulomb.evidence.contributions))
    tables = tomllib.loads(text)
    assert min(tables["drivetrain"]["no_load_current_A"]) > 0
    again = compare(from_columns(with_drag(0.2)), load_simulation(tables), effects=stated_effects(tables)).answer
    assert again.verdict == "consistent"


def test_what_was_found_is_still_told_how_small_it_could_have_been(coulomb: Comparison) -> None:
    """An effect's sensitivity is measured without itself in the fit."""
    (effect,) = coulomb.answer.effects
    (least,) = [one for one in coulomb.answer.sensitivity if one.name == effect.name]
    assert 0 < least.smallest_detectable < effect.parameters["coulomb_current"].value


def test_a_wheel_whose_gain_is_a_little_off_lacks_no_physics() -> None:
    """Each wheel's gain has an error of its own; the corrected simulation has it too."""
    table, sim = columns(5, length_s=400.0), simulation()
    table["motor_current_A"] = table["motor_current_A"] * np.where(table["wheel"] == 6, 1.05, 1.0)
    found = compare(from_columns(table), sim)
    assert found.answer.verdict == "consistent"
    tables = corrected_tables(TABLES, sim, found.evidence.values, found.evidence.contributions)
    gains = tables["drivetrain"]["gain_factor"]
    assert gains[5] < min(gains[:5]) - 0.01


def test_a_drag_that_warmth_takes_away_may_hold_one_that_stays() -> None:
    """Cold grease and dry friction together: both are named, or the one that is says that the other may be there."""
    table = with_drag(0.15)
    warm = table["motor_temperature_degC"]
    falls = np.exp((np.min(warm) - warm) / 8) * np.sign(table["motor_speed_rad_s"])
    table["motor_current_A"] = table["motor_current_A"] + 0.2 * np.mean(np.abs(table["motor_current_A"])) * falls
    answer = compare(from_columns(table), simulation()).answer
    told = {e.name for e in answer.effects} | {name for one in answer.indistinguishable for name in one.effects}
    assert {"cold-lubricant-friction", "coulomb-friction"} <= told


def test_constant_speed_on_flat_ground_cannot_tell_frictions_apart() -> None:
    """Coulomb and viscous friction and cohesion are one there; the answer says so, and what to drive."""
    answer = compare(from_columns(with_drag(0.25, speed=0.25)), simulation()).answer
    (found,) = [one for one in answer.indistinguishable if "coulomb-friction" in one.effects]
    assert "viscous-friction" in found.effects
    assert "hold at least four values of the wheel speed" in found.experiment.lower()
    assert {"wheel_speed", "direction"} <= set(found.vary)
    assert found.lift
    assert "lift the wheels" in found.experiment, "what cohesion may hide shows where there is no soil"
    assert f"{found.duration_s:.0f} s in all" in found.experiment


def test_a_twentieth_of_drag_shows_once_the_wheels_are_lifted() -> None:
    """A drive on soil may hide it in cohesion and gain; wheels that carry nothing have neither."""
    table, sim = with_drag(0.05, length_s=400.0), simulation()
    on_soil = from_columns(table)
    assert not compare(on_soil, sim).answer.effects
    asked = np.nan_to_num(build_problem(on_soil, sim).prediction).ravel()
    lifted = table["t_s"] > 250
    for name, there in (
        ("load_N", 0.2),
        ("ground_speed_m_s", 0.0),
        ("motor_current_A", table["motor_current_A"] - asked),
    ):
        table[name] = np.where(lifted, there, table[name])
    comparison = compare(from_columns(table), sim)
    assert {effect.name for effect in comparison.answer.effects} == {"coulomb-friction"}
    assert any("turn in the air" in note for note in comparison.answer.notes)


@pytest.mark.parametrize("missing", [("load_N", "pitch_rad"), ("motor_temperature_degC", "bus_voltage_V")])
def test_missing_columns_cost_only_what_needs_them(missing: tuple[str, ...]) -> None:
    """The rest is answered, and what could not be looked for is said."""
    table = with_drag(0.5)
    for name in missing:
        del table[name]
    answer = compare(from_columns(table), simulation()).answer
    assert "coulomb-friction" in {effect.name for effect in answer.effects}
    assert any("Not looked for" in note for note in answer.notes)


def test_a_wheel_that_never_turns_is_said_and_left_out() -> None:
    """Nothing is claimed of it."""
    table = with_drag(0.3, length_s=200.0)
    table["motor_speed_rad_s"] = np.where(table["wheel"] == 5, 0.0, table["motor_speed_rad_s"])
    answer = compare(from_columns(table), simulation()).answer
    assert any("nothing to compare at wheel 5" in note for note in answer.notes)
    assert all(5 not in effect.wheels for effect in answer.effects)


def test_single_readings_far_out_are_left_out() -> None:
    """Ten readings of an ampere are a fault of the recording."""
    table = columns(5)
    table["motor_current_A"][::1800] = 1.0
    answer = compare(from_columns(table), simulation()).answer
    assert answer.verdict == "consistent"
    assert any("far outside" in note for note in answer.notes)


LENGTH_S = 240.0
ONE_SIDE_IS_THE_OTHER = {1: 2, 2: 1, 3: 4, 4: 3, 5: 6, 6: 5}


@cache
def worn_drive() -> dict[str, NDArray[np.float64]]:
    """Return a drive in which wheel 3 drags from half of it on."""
    table = columns(8, length_s=LENGTH_S)
    drag = 0.8 * np.mean(np.abs(table["motor_current_A"])) * np.sign(table["motor_speed_rad_s"])
    later = (table["wheel"] == 3) & (table["t_s"] > LENGTH_S / 2)
    return {**table, "motor_current_A": table["motor_current_A"] + drag * later}


@cache
def as_it_was() -> Answer:
    """Return what is said of that drive."""
    return compare(from_columns(worn_drive()), simulation()).answer


@pytest.mark.parametrize(("origin_s", "mirrored"), [(1.7e9, False), (-3600.0, True)])
def test_the_answer_does_not_hang_on_how_the_recording_is_written(origin_s: float, *, mirrored: bool) -> None:
    """Names, wheels, onsets and sizes stay; a mirrored rover has its fault on the other side."""
    table = dict(worn_drive())
    if mirrored:
        table["wheel"] = np.vectorize(ONE_SIDE_IS_THE_OTHER.__getitem__)(table["wheel"].astype(int)).astype(float)
        table |= {name: -table[name] for name in ("roll_rad", "yaw_rate_rad_s")}
    table["t_s"] = table["t_s"] + origin_s
    order = np.random.default_rng(1).permutation(len(table["t_s"]))
    answer = compare(from_columns({name: values[order] for name, values in table.items()}), simulation()).answer
    expected = as_it_was()
    assert [e.name for e in expected.effects] == ["bearing-drag"]
    assert answer.verdict == expected.verdict
    for now, before in zip(answer.effects, expected.effects, strict=True):
        assert now.name == before.name
        assert now.wheels == tuple(ONE_SIDE_IS_THE_OTHER[w] if mirrored else w for w in before.wheels)
        assert now.onset_s == pytest.approx(before.onset_s, abs=0.2)
        assert now.parameters["relative_size"].value == pytest.approx(
            before.parameters["relative_size"].value, rel=1e-3
        )
    assert answer.fit.held_out_rmse_after == pytest.approx(expected.fit.held_out_rmse_after, rel=1e-4)
