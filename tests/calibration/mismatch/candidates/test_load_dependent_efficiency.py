"""A loss that depends on the transmitted torque: what of it a machine can lose."""

from __future__ import annotations

import numpy as np
import pytest
from linear_machine import problem_of, table

from regolithd.calibration.mismatch.candidates.load_dependent_efficiency import LoadDependentEfficiency

LOSS = LoadDependentEfficiency()
AT_TWICE = {"power": 1.0, "reference_size": 1.0}
"""The linear machine predicts 2 V throughout: twice the reference."""


@pytest.mark.parametrize(
    ("coefficient", "possible"), [(0.5, True), (0.99, True), (1.01, False), (-0.3, True), (-0.4, False)]
)
def test_a_third_of_the_efficiency_is_left(coefficient: float, possible: bool) -> None:
    """Three times the predicted current at most, and no less than a third of it."""
    assert LOSS.plausible(problem_of(table()), AT_TWICE, [coefficient]) == possible


def test_a_loss_at_light_loads_is_held_against_the_loads_that_there_are() -> None:
    """At twice the scale of its decay an eighth of it is left."""
    problem = problem_of(table())
    assert LOSS.plausible(problem, {"light": 1.0, "reference_size": 1.0}, [14.0])
    assert not LOSS.plausible(problem, {"light": 1.0, "reference_size": 1.0}, [15.0])


def test_the_columns_are_the_predicted_size_times_the_loss() -> None:
    """Against the motion, in all three forms."""
    problem = problem_of(table())
    direction = problem.covariates["direction"]
    for shape, of_size in (
        ({"power": 2.0}, 4.0),
        ({"light": 2.0}, np.exp(-1.0)),
        ({"bent": 0.25}, 1 / 0.75),
    ):
        (column,) = LOSS.columns(problem, {**shape, "reference_size": 1.0})
        np.testing.assert_allclose(column, 2.0 * of_size * direction)
