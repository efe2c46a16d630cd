"""The size of an effect in each single recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_fleet import DEVIATION, DRAG, GROUPS, WAVE, drive, equations_of, on_both, term

from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.equations import fleet_equations
from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm, Units
from regolithd.calibration.mismatch.fleet.told.estimates import estimates_of

SIZES = (0.0, 0.0, 0.1, 0.2, 0.3)
DRIVES = [drive(n, {**on_both(1, size), **on_both(3, 0.1)}) for n, size in enumerate(SIZES)]


def test_the_size_is_that_of_least_squares_in_the_recording_alone() -> None:
    """With all else as the fleet's fit has it, and before the onset too."""
    of = equations_of(DRIVES, (0,) * 5)
    fit = of.fit((term(WAVE, Course("always")), term(DRAG, Course("since", 2))))
    found = dict(estimates_of(of, fit, 1))
    assert list(found) == [0, 1, 2, 3, 4]
    assert [estimate.acts for estimate in found.values()] == [False, False, True, True, True]
    for i, estimate in found.items():
        column = DRIVES[i].columns[1] / DEVIATION
        rest = DRIVES[i].residual.copy()
        for at, factor, value in zip(fit.columns, fit.factors[:, i, 0], fit.coefficients, strict=True):
            rest -= 0.0 if at == 1 else value * factor * DRIVES[i].columns[at]
        energy = np.sum(column**2)
        assert estimate.value == pytest.approx(np.sum(column * rest / DEVIATION) / energy)
        assert estimate.std == pytest.approx(1 / np.sqrt(energy))
        assert estimate.wheels == (0, 1)
        assert abs(estimate.value - SIZES[i]) < 4 * estimate.std


def test_each_rover_s_recordings_are_beside_its_own_size() -> None:
    """Of an effect with a size for each rover."""
    of = equations_of([drive(n, on_both(1, 0.4 if n % 2 else 0.1)) for n in range(4)], (0, 1, 0, 1))
    fit = of.fit((FleetTerm(DRAG, Units((0, 1), (0, 1), each=True), Course("always")),))
    found = dict(estimates_of(of, fit, 0))
    assert [round(found[i].value, 1) for i in range(4)] == [0.1, 0.4, 0.1, 0.4]


def test_a_recording_without_the_effect_s_wheel_has_no_estimate() -> None:
    """Nor has one in which the column is 0."""
    silent, lacking = DRIVES[0].sums(), DRIVES[1].sums()
    gram = silent.gram.copy()
    gram[:, 1, :] = gram[:, :, 1] = 0.0
    names = ("gram", "moment", "fourth", "energy", "counts", "weights")
    lacking = replace(lacking, wheels=("left",), **{name: getattr(lacking, name)[:1] for name in names})
    sums = [replace(silent, gram=gram), lacking, DRIVES[3].sums()]
    of = fleet_equations(sums, (0,) * 3, (0.0, 1.0, 2.0), GROUPS, "rover")
    on_right = dict(estimates_of(of, of.fit((term(DRAG, Course("always"), wheels=(1,)),)), 0))
    assert list(on_right) == [2]
    on_all = dict(estimates_of(of, of.fit((term(DRAG, Course("always")),)), 0))
    assert {i: estimate.wheels for i, estimate in on_all.items()} == {1: (0,), 2: (0, 1)}
