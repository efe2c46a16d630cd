"""The equations of a problem: all columns, weighted by the noise of the residual."""

from __future__ import annotations

import numpy as np
import pytest
from linear_machine import CANDIDATES, NOISE, Constant, problem_of, table

from regolithd.calibration.mismatch.regression.equations import (
    free_parameter_equations,
    smooth_equations,
    with_library,
)


class Inapplicable(Constant):
    """A candidate that no recording allows."""

    name = "inapplicable"

    def applies(self, problem: object) -> bool:  # noqa: ARG002
        """Return that it does not apply."""
        return False


def test_the_columns_are_those_of_parameters_candidates_and_smooth_terms() -> None:
    """Candidates that the recording does not allow have none; what applies is returned."""
    equations, applicable = with_library(smooth_equations(problem_of(table())), (*CANDIDATES, Inapplicable()))
    named = [group.name for group in equations.design.groups if group.candidate is not None]
    assert applicable == CANDIDATES
    assert set(named) == {candidate.name for candidate in CANDIDATES}
    assert equations.nuisance.names == ("level",)
    assert [group for group in equations.design.groups if group.candidate is None]


def test_the_weights_are_those_of_the_noise() -> None:
    """White noise has a weight of one over its variance on each axis."""
    equations = smooth_equations(problem_of(table()))
    np.testing.assert_allclose(equations.weights, NOISE**-2, rtol=0.5)


def test_the_free_parameters_alone_have_no_group() -> None:
    """Noise, folds and the parameters' columns are those of all equations."""
    problem = problem_of(table())
    alone, every = free_parameter_equations(problem), smooth_equations(problem)
    assert alone.design.groups == ()
    assert alone.design.size == len(alone.nuisance.columns) == 1
    assert alone.weights == pytest.approx(every.weights)
    np.testing.assert_array_equal(alone.design.order, every.design.order)
    np.testing.assert_allclose(alone.moment, every.moment[:, :1])
