"""A parameter that errors of inputs may have moved out of its prior is no finding; one that they cannot have, is."""

from __future__ import annotations

import heated_room
import pytest

from regolithd.calibration.mismatch.answer import CalibratedParameter
from regolithd.calibration.mismatch.comparison import decided
from regolithd.calibration.mismatch.inference.findings import beside_lasting_errors

PRIORS = heated_room.Room.parameters


def moved(width_stds: float) -> tuple[CalibratedParameter, ...]:
    """Return a warmth that is five standard deviations off, with an interval of so many to either side."""
    prior = PRIORS["warmth_K_A2"]
    value, reach = prior.value + 5 * prior.std, width_stds * prior.std
    warmth = CalibratedParameter("warmth_K_A2", prior.unit, prior.value, prior.std, value, value - reach, value + reach)
    memory = PRIORS["memory_s"]
    return warmth, CalibratedParameter("memory_s", "s", memory.value, memory.std, memory.value, 3500, 3700)


@pytest.fixture(scope="module")
def room() -> heated_room.Room:
    """Return a room whose heater's current is read with an error that its temperature adds up."""
    return heated_room.ReadRoom()


def test_a_value_within_what_errors_do_to_it_is_held_by_its_prior(room: heated_room.Room) -> None:
    """As far as the readings know it beside these errors."""
    decision = decided(heated_room.recorded(4), room, effects=()).decision
    parameters = moved(4.0)
    found = beside_lasting_errors(decision, None, parameters)
    assert [each.name for each in found] == [each.name for each in parameters]
    assert not any(each.beyond_prior() for each in found)


def test_a_value_beyond_that_stays(room: heated_room.Room) -> None:
    """Five deviations off, and known to a half of one."""
    decision = decided(heated_room.recorded(4), room, effects=()).decision
    assert beside_lasting_errors(decision, None, moved(0.5)) == moved(0.5)


def test_without_such_errors_nothing_is_held() -> None:
    """The interval says how well a value is known."""
    decision = decided(heated_room.recorded(4, error_A=0.0), heated_room.Room(), effects=()).decision
    assert beside_lasting_errors(decision, None, moved(4.0)) == moved(4.0)
