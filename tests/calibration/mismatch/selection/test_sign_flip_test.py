"""The sign-flip test: the largest score by chance, and the threshold made of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from linear_machine import AXES, INSTANTS, Power, design_of, equations_of, problem_of, table

from regolithd.calibration.mismatch.selection.sign_flip_test import (
    block_scores,
    entry_threshold,
    largest_by_chance,
    sign_flipped,
)

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

BLOCKS = np.arange(INSTANTS) // 20


def equations_and_noise(**changes: float) -> tuple[NormalEquations, np.ndarray]:
    """Return equations whose thresholds are changed, and the noise of their recording."""
    problem = problem_of(table())
    problem = replace(problem, thresholds=replace(problem.thresholds, **changes))  # type: ignore[arg-type]
    return equations_of(problem), np.where(problem.mask, problem.measured - 2.0, 0)


def test_block_scores_add_up_to_the_moments() -> None:
    """Weighted products of columns and residual, over each block of each axis."""
    equations, noise = equations_and_noise()
    at = np.array([1, 2])
    scores = block_scores(equations, at, noise, BLOCKS)
    assert scores.shape == (INSTANTS // 20, AXES, 2)
    np.testing.assert_allclose(scores.sum(axis=0), equations.moment[:, at], rtol=1e-3, atol=1e-2)
    design = equations.design
    column = design.in_time(design.columns([2])[0])
    here = (column * noise * equations.weights)[BLOCKS == 7].sum(axis=0)
    np.testing.assert_allclose(scores[7, :, 1], here, rtol=1e-3, atol=1e-3)


def test_flipped_moments_are_sums_with_random_signs() -> None:
    """Their mean is 0 and their variance the sum of squares; the same every time."""
    scores = np.random.default_rng(0).normal(size=(30, 2, 3))
    drawn = sign_flipped(scores, 4000)
    assert drawn.shape == (4000, 2, 3)
    np.testing.assert_allclose(drawn.mean(axis=0), 0, atol=0.4)
    np.testing.assert_allclose(drawn.var(axis=0), (scores**2).sum(axis=0), rtol=0.1)
    np.testing.assert_array_equal(drawn, sign_flipped(scores, 4000))


def test_scores_by_chance_are_those_of_noise() -> None:
    """A single candidate's Δχ² by chance is χ² with one degree of freedom, with a sign half the time."""
    equations, noise = equations_and_noise(sign_flip_draws=2000)
    only = equations.with_groups([group for group in equations.design.groups if group.name == "drag"])
    found = largest_by_chance(only, noise, BLOCKS)
    assert found.shape == (2000,)
    assert np.mean(found > 4.0) < 0.01
    assert -2 < np.median(found) < 0.0
    everything = largest_by_chance(equations, noise, BLOCKS)
    assert np.all(everything >= found - 1e-9)


def test_the_threshold_falls_with_the_rate_of_false_names_that_is_allowed() -> None:
    """Monotone, and within its limits."""
    limits = {"least_entry": -100.0, "largest_entry": 100.0}
    found = [entry_threshold(*equations_and_noise(false_name_rate=rate, **limits), BLOCKS) for rate in (0.5, 0.1, 0.01)]
    assert found == sorted(found)
    equations, noise = equations_and_noise(false_name_rate=0.5, sign_flip_margin=3.0, **limits)
    assert entry_threshold(equations, noise, BLOCKS) == pytest.approx(found[0] + 2.0)
    assert entry_threshold(*equations_and_noise(false_name_rate=0.5), BLOCKS) == 5.0
    equations, noise = equations_and_noise()
    assert entry_threshold(equations, 50 * noise, BLOCKS) == 12.0


def test_without_candidates_nothing_is_found_by_chance() -> None:
    """The scores are zero, and the threshold its least."""
    problem = problem_of(table())
    empty = equations_of(problem, ())
    np.testing.assert_array_equal(largest_by_chance(empty, problem.measured * 0, BLOCKS), 0)
    assert design_of(problem).size == 0
    assert Power().name == "power"
