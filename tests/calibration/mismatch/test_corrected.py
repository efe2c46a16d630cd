"""Friction larger than all the current that the simulation expects: named, corrected, and then consistent."""

import tomllib
from typing import Any

import numpy as np
import pytest
from drives import TABLES, columns, simulation

from regolithd.calibration.mismatch.comparison import Comparison, compare
from regolithd.calibration.mismatch.corrected import corrected_tables, stated_effects
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel
from regolithd.calibration.toml_document import to_toml

CONCEALED_A = 0.037


@pytest.fixture(scope="module")
def dragging() -> Recording:
    """Return a recording with a constant drag that no prior can stand in for."""
    table = columns(3)
    moving = np.abs(table["motor_speed_rad_s"]) > 0
    table["motor_current_A"] = table["motor_current_A"] + CONCEALED_A * np.sign(table["motor_speed_rad_s"]) * moving
    return from_columns(table)


@pytest.fixture(scope="module")
def found(dragging: Recording) -> Comparison:
    """Return the comparison with the simulation that has no friction."""
    return compare(dragging, simulation())


def _corrected(found: Comparison) -> dict[str, Any]:
    evidence = found.evidence
    tables = corrected_tables(TABLES, simulation(), evidence.values, evidence.contributions, found.answer.effects)
    return tomllib.loads(to_toml(tables))


def test_it_is_named_though_the_priors_are_what_tells_it_from_the_gain(found: Comparison) -> None:
    """Most of the gain is the priors': held-out errors alone would not bring half of it back."""
    assert [effect.name for effect in found.answer.effects] == ["coulomb-friction"]


def test_the_drivetrain_has_it_and_says_how_sure(found: Comparison) -> None:
    """In the daemon's own words, with a standard deviation that a person would believe."""
    drivetrain = _corrected(found)["drivetrain"]
    assert drivetrain["no_load_current_A"] == pytest.approx([CONCEALED_A] * 6, rel=0.1)
    assert 1e-5 < drivetrain["no_load_current_std_A"][0] < 5e-3


def test_the_corrected_simulation_is_consistent_with_the_same_recording(dragging: Recording, found: Comparison) -> None:
    """What was found is not found again."""
    tables = _corrected(found)
    again = compare(dragging, RoverWheel.from_tables(tables), effects=stated_effects(tables))
    assert again.answer.verdict == "consistent"


def test_parameters_that_lean_over_stay_where_they_can_be(found: Comparison) -> None:
    """Three standard deviations at most, whatever the recording says."""
    moved = {**found.evidence.values, "gain_factor": -0.5, "friction_angle_deg": 70.0}
    tables = corrected_tables(TABLES, simulation(), moved, ())
    assert tables["drivetrain"]["gain_factor"] == pytest.approx([1 - 3 * 0.02] * 6)
    assert tables["soil"]["friction_angle_deg"] == pytest.approx(30.3 * (1 + 3 * 0.02))
