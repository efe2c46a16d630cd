"""An empirical curve in a corrected simulation: what it adds, how it is read and written, and what changed of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_machine import problem_of, table

from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.empirical.stated import EmpiricalCurveLaw, beyond_the_range, name_of
from regolithd.calibration.mismatch.empirical.written import summed, with_changed_sizes
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve, StatedCurve
from regolithd.calibration.mismatch.simulation.corrected_curves import entry_of, stated_curves

CURVE = EmpiricalCurve(
    "drag", True, "V", "rad/s", (0.2, 0.6, 1.0), (0.0, 1.0, 3.0), (-0.2, 0.8, 2.8), (0.2, 1.2, 3.2), 0.3, 0.2
)
STATED = StatedCurve("reading_V", (1, 2), "wheel_speed", CURVE)


def test_it_acts_against_the_motion_and_keeps_its_end_values() -> None:
    """Piecewise linear in the magnitude of the speed; beyond the last knot as at the last knot."""
    problem = problem_of(table())
    (column,) = EmpiricalCurveLaw(STATED).columns(problem, {})
    speed = problem.covariates["wheel_speed"]
    fast, slow = np.abs(speed) > 1.0, (np.abs(speed) > 0.2) & (np.abs(speed) < 0.6)
    assert fast.any()
    assert column[fast] == pytest.approx(3 * np.sign(speed[fast]))
    assert column[slow] == pytest.approx((2.5 * np.abs(speed) - 0.5)[slow] * np.sign(speed[slow]))


def test_a_recording_that_leaves_the_range_is_told() -> None:
    """Where nothing is known of it, it proves nothing."""
    problem = problem_of(table())
    (note,) = beyond_the_range(problem, [STATED])
    assert "outside the range of the empirical curve over wheel_speed (0.2 to 1)" in note
    wide = replace(STATED, curve=replace(CURVE, at=(0.0, 0.6, 1e3)))
    assert beyond_the_range(problem, [wide]) == ()


def test_a_curve_over_what_was_not_recorded_is_an_error() -> None:
    """Without the covariate the prediction would be wrong in silence."""
    with pytest.raises(SimulationError, match="depends on height, which this recording does not have"):
        EmpiricalCurveLaw(replace(STATED, covariate="height")).columns(problem_of(table()), {})


def test_it_comes_back_from_the_file_as_it_was_written() -> None:
    """With the statement that it is no physics."""
    entry = entry_of(STATED)
    assert "No physics" in entry["statement"]
    assert stated_curves({"empirical_curves": [entry]}) == (STATED,)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"at": [1.0, 0.6, 0.2]}, "at must ascend"),
        ({"value": [1.0]}, "as many numbers"),
        ({"coupling": None}, "needs wheels"),
    ],
)
def test_a_damaged_curve_is_an_error_that_says_what_is_missing(changed: dict[str, object], told: str) -> None:
    """Knots in disorder, too few values, or a missing key."""
    entry = {key: value for key, value in {**entry_of(STATED), **changed}.items() if value is not None}
    with pytest.raises(SimulationError, match=told):
        stated_curves({"empirical_curves": [entry]})


def test_a_change_of_its_size_goes_into_the_curve() -> None:
    """Half of it is gone: half of it is written, and other effects' changes are left."""
    other = Contribution("coulomb-friction", {}, (1.0,), (1, 2))
    change = Contribution(name_of(STATED), {}, (-0.5,), (1, 2))
    (curve,), rest = with_changed_sizes([STATED], [change, other])
    assert curve.curve.value == (0.0, 0.5, 1.5)
    assert rest == [other]


def test_two_curves_of_one_place_are_summed_over_both_ranges() -> None:
    """Errors add in squares; a curve of other wheels stays apart."""
    more = replace(STATED, curve=replace(CURVE, at=(0.2, 0.4, 1.4), value=(1.0, 1.0, 1.0)))
    elsewhere = replace(STATED, wheels=(1,))
    both, apart = summed([STATED, more, elsewhere])
    assert both.curve.at == (0.2, 0.4, 0.6, 1.0, 1.4)
    assert both.curve.value == pytest.approx((1.0, 1.5, 2.0, 4.0, 4.0))
    assert both.curve.high[0] - both.curve.value[0] == pytest.approx(0.2 * np.sqrt(2))
    assert apart == elsewhere
