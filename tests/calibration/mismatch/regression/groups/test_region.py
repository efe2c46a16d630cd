"""Regions of a covariate."""

from __future__ import annotations

import numpy as np
from linear_machine import problem_of, table

from regolithd.calibration.mismatch.regression.groups.region import Region
from regolithd.calibration.mismatch.regression.groups.smooth_groups import acting


def test_columns_are_zero_outside_and_powers_of_the_distance_inside() -> None:
    """The lower bound is in the region, the upper one is not; a speed counts by its magnitude."""
    problem = problem_of(table())
    region = Region("wheel_speed", "drag", 0.5, 1.0, (0, 1), 0.5, 2.0)
    step, growth = region.columns(*acting(problem, "wheel_speed", "drag"))
    speed = problem.covariates["wheel_speed"]
    inside = (np.abs(speed) >= 0.5) & (np.abs(speed) < 1.0)
    assert inside.any()
    np.testing.assert_array_equal(step, np.where(inside, np.sign(speed), 0.0))
    np.testing.assert_allclose(growth, np.where(inside, np.sign(speed) * (np.abs(speed) - 0.5) / 2, 0.0))


def test_what_is_unknown_is_in_no_region() -> None:
    """A blank of the covariate is neither below nor beyond."""
    region = Region("load", "offset", -np.inf, np.inf, (0,), 0.0, 1.0)
    assert region.contains(np.array([1.0, np.nan])).tolist() == [True, False]


def test_what_acts_one_way_only_has_the_signed_speed() -> None:
    """As its smooth term has it."""
    problem = problem_of(table())
    values, factor = acting(problem, "wheel_speed", "each way")
    assert values.min() < 0
    assert np.all(factor == 1)
