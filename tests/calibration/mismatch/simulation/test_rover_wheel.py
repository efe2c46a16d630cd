"""The built-in rover wheel: prediction, places of the wheels, derived channels, and tables that it reads and writes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rover_drives import TABLES, columns, recording, simulation

from regolithd.calibration.mismatch import SimulationError, from_columns, load_simulation
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel, slip_sunk

WHEELS = (1, 2, 3, 4, 5, 6)


def test_odd_wheels_are_left_and_the_first_two_in_front() -> None:
    """Sides and rows may share an effect; roll and pitch act oppositely on them."""
    rover = simulation()
    np.testing.assert_array_equal(rover.side(WHEELS), [-1, 1, -1, 1, -1, 1])
    np.testing.assert_array_equal(rover.row(WHEELS), [0, 0, 1, 1, 2, 2])
    assert rover.wheel_sets(WHEELS) == [(0, 2, 4), (1, 3, 5), (0, 1), (2, 3), (4, 5)]
    np.testing.assert_array_equal(rover.contrasts("roll", WHEELS)["opposite sides"], rover.side(WHEELS))
    np.testing.assert_array_equal(rover.contrasts("yaw_rate", WHEELS)["opposite sides"], rover.side(WHEELS))
    np.testing.assert_array_equal(rover.contrasts("pitch", WHEELS)["opposite ends"], [-1, -1, 0, 0, 1, 1])
    assert rover.contrasts("pitch", (1, 2)) == {}
    assert rover.contrasts("temperature", WHEELS) == {}


def test_the_current_follows_load_and_direction() -> None:
    """More load and stronger soil need more current; a reversed wheel the opposite one."""
    problem = build_problem(recording(length_s=120.0, noise=0.0), simulation())
    forwards = problem.covariates["wheel_speed"] > 0
    assert np.all(problem.prediction[forwards & problem.mask] > 0)
    assert np.all(problem.prediction[~forwards & problem.mask] < 0)
    heavier = problem.with_input("load_N", 1.2 * problem.recording.channels["load_N"])
    assert np.all((np.abs(heavier) > np.abs(problem.filled))[problem.mask])
    stronger = problem.changed(cohesion_Pa=1500.0)
    assert np.mean(np.abs(stronger)) > np.mean(np.abs(problem.filled))
    half = problem.changed(gain_factor=2.0)
    bias = problem.error_bias  # what the inputs' errors add is that of the stated parameters
    np.testing.assert_allclose((half - bias)[problem.mask], 0.5 * (problem.filled - bias)[problem.mask])


def test_variants_are_neutral_as_they_stand() -> None:
    """And each changes the prediction when it is moved."""
    problem = build_problem(recording(length_s=120.0), simulation())
    variants = problem.simulation.variants()
    np.testing.assert_array_equal(problem.changed(**variants), problem.filled)
    for name, value in variants.items():
        assert np.any(problem.changed(**{name: value + 0.3}) != problem.filled), name


def test_what_was_not_measured_is_assumed_and_noted() -> None:
    """Without load cells each wheel carries a sixth; without ground speed slip is as stated."""
    table = columns(length_s=60.0)
    del table["load_N"], table["ground_speed_m_s"]
    prepared = simulation().prepare(from_columns(table))
    carried = prepared.channels["load_N"]
    assert np.ptp(carried) == 0
    assert carried[0, 0] == pytest.approx(simulation().tables.rover.mass_kg * 9.81 / 6)
    assert set(np.unique(prepared.channels["slip"][np.isfinite(prepared.channels["slip"])])) == {0.025}
    assert any("never measured" in note for note in prepared.notes)
    assert any("blank at" in note for note in prepared.notes)


def test_lifted_wheels_carry_nothing_and_need_no_current() -> None:
    """Where no cell reads a newton the rover stands on a block."""
    table = columns(length_s=60.0)
    table["load_N"] = np.where(table["t_s"] > 30, 0.3, table["load_N"])
    problem = build_problem(from_columns(table), simulation())
    lifted = problem.time_s[:, 0] > 30
    turning = problem.mask & lifted[:, None]
    assert turning.any()
    assert not problem.filled[turning].any()
    assert any("turn in the air" in note for note in problem.recording.notes)


def test_slip_sinks_a_wheel_deeper() -> None:
    """The contact angle grows with strength and with slip, and not at all at strength 0."""
    angle, slip = np.array([0.3, 0.3]), np.array([0.1, 0.5])
    np.testing.assert_allclose(slip_sunk(angle, slip, 0.0), angle)
    deep, deeper = slip_sunk(angle, slip, 1.0)
    assert 0.3 < deep < deeper
    # z ∝ 1 − cos θ; Lyasko's factor at slip 0.1 is 1.1 / 0.95.
    assert (1 - np.cos(deep)) / (1 - np.cos(0.3)) == pytest.approx(1.1 / 0.95)


def test_tables_come_back_with_the_calibrated_values() -> None:
    """The gain is per wheel, with each wheel's own deviation; wrong tables are refused with their place."""
    values = {"gain_factor": 1.1, "gain_factor of 4": 0.05, "cohesion_Pa": 1300.0, "friction_angle_deg": 31.0}
    tables = simulation().corrected_tables(values)
    np.testing.assert_allclose(tables["drivetrain"]["gain_factor"], [1.1, 1.1, 1.1, 1.15, 1.1, 1.1])
    assert (tables["soil"]["cohesion_Pa"], tables["soil"]["friction_angle_deg"]) == (1300.0, 31.0)
    assert isinstance(load_simulation({**TABLES}), RoverWheel)
    with pytest.raises(SimulationError, match=r"soil\.cohesion_Pa"):
        RoverWheel.from_tables({**TABLES, "soil": {**TABLES["soil"], "cohesion_Pa": "much"}})


@pytest.mark.parametrize(
    ("misspelt", "keys", "meant"),
    [
        ({"drivetran": {}}, ("drivetran",), "drivetrain"),
        ({"soil": {**TABLES["soil"], "cohesion_pa": 1}}, ("soil", "cohesion_pa"), "cohesion_Pa"),
    ],
)
def test_a_misspelt_table_or_key_is_told_with_what_it_may_mean(
    misspelt: dict[str, Any], keys: tuple[str, ...], meant: str
) -> None:
    """In one message, with its place."""
    with pytest.raises(SimulationError, match=rf"{'[.]'.join(keys)}: .*; did you mean {meant}") as caught:
        RoverWheel.from_tables({**TABLES, **misspelt})
    assert caught.value.keys == keys


def test_the_place_of_a_wheel_is_what_was_driven_and_where_its_axle_stands() -> None:
    """At a constant speed, in steps of 0.2 s: the front axle is half a wheelbase ahead."""
    posed = build_problem(recording(speed=0.3, noise=0.0), simulation())
    place, wheel = posed.covariates["place"], simulation().tables
    hub_m_s = wheel.wheel.radius_m * 0.3 * (1 - posed.covariates["slip"][0, 0])
    np.testing.assert_allclose(place[:, 2], hub_m_s * posed.time_s[:, 0], rtol=0.01, atol=0.01)
    np.testing.assert_allclose(place[:, 0] - place[:, 4], wheel.rover.wheelbase_m)
