"""Parameters of rovers that were stated wrongly: a prior that recordings contradict does not hold them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from sample_answer import FINDINGS
from synthetic_fleet import DEVIATION, GROUPS, PRIOR_STD, Drive, drive

from regolithd.calibration.mismatch.fleet.choice.equations import Level, fleet_equations
from regolithd.calibration.mismatch.fleet.choice.released import with_released
from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm
from regolithd.calibration.mismatch.problem.prior import Prior

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations

STATED, TRUE = 1.5, 1.5 + 5 * PRIOR_STD
PRIORS = {"gain": Prior(STATED, PRIOR_STD, "A/A"), "offset": Prior(0.1, 0.0, "A")}
CURVE = 4


def weak(seed: int, shift: float) -> Drive:
    """Return a recording that knows the gain about as well as its prior does."""
    one = drive(seed)
    columns = one.columns.copy()
    columns[0] *= 0.08
    return replace(one, columns=columns, residual=one.residual + shift * columns[0])


def season(level: Level = "rover", *, curve: bool = False) -> tuple[FleetEquations, list[Found]]:
    """Return two rovers with two recordings each; the second's gain was stated wrongly, its last may have a curve."""
    sums = [weak(n, (TRUE - STATED) * (n % 2)).sums() for n in range(4)]
    term = FoundTerm("voltage", False, {}, (0, 1), 2.0, np.zeros((1, 1, 2), np.float32))
    found = [Found(FINDINGS, {}, DEVIATION, 1.0, 0.1, 10.0, (), {})] * 3
    if curve:
        last = weak(3, TRUE - STATED)
        last = replace(last, residual=last.residual + 0.3 * last.columns[CURVE])
        sums[3] = replace(last.sums(), own=((CURVE,),))
    found.append(replace(found[0], terms=(term,) if curve else ()))
    return fleet_equations(sums, (0, 1, 0, 1), range(4), GROUPS, level), found


def test_the_prior_of_the_rover_that_contradicts_it_is_widened() -> None:
    """The gain is then where its recordings have it; the other rover's stays held."""
    of, found = season()
    freed = with_released(of, of.fit(()), found, PRIORS)
    assert freed.released == {1}
    held, free = (each.fit(()) for each in (of, freed))
    std = float(np.sqrt(free.covariance[1, 1]))
    assert STATED + held.coefficients[1] < TRUE - 1.5 * std
    assert STATED + free.coefficients[1] == pytest.approx(TRUE, abs=2 * std)
    assert free.coefficients[0] == pytest.approx(held.coefficients[0])


def test_a_parameter_of_each_recording_is_released_by_itself() -> None:
    """As where each drive has a soil of its own."""
    of, found = season("recording")
    assert with_released(of, of.fit(()), found, PRIORS).released == {1, 3}


def test_a_parameter_is_not_released_beside_something_unexplained() -> None:
    """It may stand for a part of that."""
    of, found = season(curve=True)
    assert with_released(of, of.fit(()), found, PRIORS) is of


@pytest.mark.parametrize(
    ("wrong", "released"), [((5.0, 5.0, 2.6), {0, 1, 2}), ((5.0, 0.0, 2.6), {0}), ((3.6, 3.6, 3.6), {0, 1, 2})]
)
def test_what_most_rovers_contradict_holds_none_of_them(wrong: tuple[float, ...], released: set[int]) -> None:
    """One value is stated for all; the third rover, by itself, hardly contradicts it."""
    sums = [weak(n, wrong[n % 3] * PRIOR_STD).sums() for n in range(6)]
    of = fleet_equations(sums, (0, 1, 2) * 2, range(6), GROUPS, "rover")
    found = [Found(FINDINGS, {}, DEVIATION, 1.0, 0.1, 10.0, (), {})] * 6
    assert with_released(of, of.fit(()), found, PRIORS).released == released
