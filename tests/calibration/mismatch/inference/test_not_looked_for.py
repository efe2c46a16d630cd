"""Notes tell the candidates that a user can have looked for, and none that another machine has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from linear_machine import Constant, Level, table

from regolithd.calibration.mismatch import from_columns, library
from regolithd.calibration.mismatch.candidates.candidate import UNITS_OF_NO_LOAD
from regolithd.calibration.mismatch.inference.not_looked_for import WITHOUT_SPEED, not_looked_for
from regolithd.calibration.mismatch.problem.build import build_problem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.problem.problem import Problem

    Array = NDArray[np.float64]


class Pitched(Level):
    """A machine with a pitch: a vehicle."""

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and pitch."""
        return {"wheel_speed": inputs["speed_rad_s"], "pitch": np.sin(inputs["t_s"])}


class Oven(Level):
    """A machine in which nothing moves."""

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:  # noqa: ARG002
        """Return nothing."""
        return {}


class Temperature(Level):
    """The reading is a temperature."""

    unit = "°C"


class WarmOven(Oven):
    """A machine in which nothing moves, and whose temperature is predicted."""

    unit = "°C"


class OnlyElsewhere(Constant):
    """An effect of the user's own."""

    name, needs = "clogging", "the channel rise_Pa"

    def applies(self, problem: Problem) -> bool:  # noqa: ARG002
        """Never."""
        return False


def notes_of(simulation: Level, *more: Candidate) -> list[str]:
    """Return the notes about the library and more."""
    problem = build_problem(from_columns(table(), unit="axis"), simulation)
    candidates = [*library(), *more]
    applicable = {each.name for each in candidates if each.applies(problem)}
    return not_looked_for(problem, candidates, applicable)


def test_a_machine_that_is_no_vehicle_lacks_no_slopes_and_no_soil() -> None:
    """Only a temperature would bring something."""
    assert notes_of(Level()) == [
        "Not looked for without temperature: cold-lubricant-friction, torque-constant-temperature."
    ]


def test_a_vehicle_is_told_what_it_does_not_measure() -> None:
    """One covariate of a vehicle makes it one."""
    (note,) = notes_of(Pitched())
    assert "without yaw_rate: turning-resistance" in note
    assert "without load and roll: load-cell-drift" in note
    assert "grade-resistance" not in note


def test_a_machine_without_a_speed_is_told_so_once() -> None:
    """Not with a dozen names."""
    assert notes_of(Oven()) == [f"Not looked for without wheel_speed: {WITHOUT_SPEED}."]
    assert notes_of(WarmOven()) == []


def test_a_unit_of_no_load_is_told_where_all_else_is_there() -> None:
    """Friction is then missed by somebody who gives a speed; a temperature of the motor brings nothing."""
    (note,) = notes_of(Temperature())
    assert note.startswith("Not looked for, as °C is no unit of a load: bearing-drag, coulomb-friction")
    assert "cold-lubricant-friction" not in note


def test_an_effect_of_the_users_own_says_what_it_asks_for() -> None:
    """It is never another machine's."""
    assert notes_of(WarmOven(), OnlyElsewhere()) == ["Not looked for without the channel rise_Pa: clogging."]


def test_a_unit_is_no_load_s_however_it_is_written() -> None:
    """FMUs have `m3/s`, people `m³/s`; a torque may be in any unit that is not listed."""
    assert {"m3/s", "m³/s", "m/s2", "m/s²", "degC", "rpm"} <= UNITS_OF_NO_LOAD
    assert UNITS_OF_NO_LOAD.isdisjoint({"N", "N·m", "A", "W", "bar", "1", "%", "lbf ft"})
