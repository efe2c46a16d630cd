"""The search for the parameters' values with which the simulation itself fits a recording best, from one place on.

The objective is −2 log of the posterior density with the unknown variance of each wheel's noise at its maximum
(concentrated likelihood):

    Σ over wheels  n / τ · ln(mean square of the residual)  +  Σ over parameters  ((value − stated) / std)²

with n readings of the wheel, and the provisional autocorrelation time τ, as the noise is not known yet. It is minimised
by Levenberg and Marquardt's method (Marquardt, 1963).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.calibration.step import Step
from regolithd.calibration.mismatch.problem.tangents.principal_axes import switches

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.prior import Prior
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ITERATIONS = 30
"""Steps of a search at most (a choice: a search that converges needs five to fifteen)."""
CONVERGED = 1e-3
"""Decrease of the objective by a step, from which on a search goes on: far less than chance changes it by."""
AS_WELL = 3.8
"""Difference of the objective up to which two minima fit equally well, and which lies between them half way if they are
two (χ² of one degree of freedom at 95 %)."""
DIFFERENCE = 1e-4
"""Step of a difference quotient in the prior's standard deviations (a choice: a search needs no exact tangents)."""
DIFFERENCE_WHERE_IT_SWITCHES = 0.1
"""The same where the simulation switches (a choice: over several change-overs, that come at whole readings)."""
FIRST_DAMPING, LESS, MORE, MOST_DAMPING = 1e-2, 0.2, 5.0, 1e8
"""Damping of a search's first step, its factors after a step that succeeds and one that fails, and the one at which no
step is left to try (Marquardt's scheme)."""


@dataclass(frozen=True, eq=False)
class Search:
    """The search of a problem. A place is in the priors' standard deviations from the stated values."""

    problem: Problem
    names: tuple[str, ...]
    wheel: NDArray[np.int64]

    @classmethod
    def of(cls, problem: Problem) -> Self:
        """Return the search over the free parameters; each reading's wheel is its place among those compared."""
        _, wheel = np.unique(np.nonzero(problem.mask)[1], return_inverse=True)
        return cls(problem, problem.free, wheel)

    @property
    def priors(self) -> list[Prior]:
        """The priors of the free parameters."""
        return [self.problem.simulation.parameters[name] for name in self.names]

    @property
    def is_wide(self) -> bool:
        """Whether a parameter is hardly known."""
        return any(prior.is_hardly_known for prior in self.priors)

    @cached_property
    def switches(self) -> bool:
        """Whether the simulation switches, so that a fit may end where it does so at the wrong readings."""
        return any(switches(self.problem, name) for name in self.names)

    def within(self, place: Array) -> Array:
        """Return a place as far as the parameters may be moved."""
        limit = self.problem.thresholds.furthest_linearisation_stds
        values, named = self.values(place), zip(self.names, self.priors, strict=True)
        return self.place({name: prior.near(values[name], limit) for name, prior in named})

    def values(self, place: Array) -> dict[str, float]:
        """Return the parameters' values at a place."""
        at = zip(self.names, self.priors, place.tolist(), strict=True)
        return {**self.problem.values, **{name: prior.value + prior.std * stds for name, prior, stds in at}}

    def left(self, place: Array) -> Array:
        """Return what the simulation leaves of the readings there, shape (reading,); NaN where it cannot be run."""
        step = Step(self.problem, self.values(place))
        return step.measured - step.run

    def objective(self, left: Array, place: Array) -> float:
        """Return −2 log of the posterior density of a place that leaves this; infinity where it cannot be run."""
        if not np.isfinite(left).all():
            return np.inf
        counts = np.bincount(self.wheel)
        time = self.problem.thresholds.provisional_autocorrelation_time
        return float(counts / time @ np.log(self.power(left)) + place @ place)

    def power(self, left: Array) -> Array:
        """Return the mean square on each wheel, shape (wheel,), above what rounding leaves."""
        counts = np.bincount(self.wheel)
        rounding = np.finfo(np.float64).eps * float(np.mean(self.problem.measured[self.problem.mask] ** 2))
        return np.asarray(np.bincount(self.wheel, left**2) / counts + rounding)

    def minimum(self, place: Array, iterations: int = ITERATIONS) -> tuple[float, Array]:
        """Return the least objective that a search from a place finds, and where."""
        left = self.left(place)
        best, damping = self.objective(left, place), FIRST_DAMPING
        for _ in range(iterations if np.isfinite(best) else 0):
            matrix, slope = self.normal(left, place)
            before, moved = best, np.ones(len(place), np.bool_)
            while damping < MOST_DAMPING:
                step = _step(matrix + damping * np.diag(np.diag(matrix)), slope, moved)
                tried = self.within(place + step)
                if np.any(held := moved & (step != 0) & (tried == place)):
                    moved &= ~held  # at its limit, and would go beyond: the others' best step is another one
                    continue
                further = self.left(tried)
                if (now := self.objective(further, tried)) < best:
                    place, left, best, damping = tried, further, now, damping * LESS
                    break
                damping *= MORE
            if before - best < CONVERGED:
                break
        return best, place

    def place(self, values: Mapping[str, float]) -> Array:
        """Return the place of the parameters' values."""
        named = zip(self.names, self.priors, strict=True)
        return np.array([(values[name] - prior.value) / prior.std for name, prior in named])

    def apart(self, found: Sequence[tuple[float, Array]]) -> list[tuple[float, Array]]:
        """Return those of the minima, objective and place each, that are not the same as one before."""
        kept: list[tuple[float, Array]] = []
        for objective, place in found:
            if all(self.are_two(place, other, max(objective, least)) for least, other in kept):
                kept.append((objective, place))
        return kept

    def are_two(self, one: Array, other: Array, objective: float) -> bool:
        """Return whether two places of about this objective are two minima: half way between them the fit is worse."""
        middle = (one + other) / 2
        return self.objective(self.left(middle), middle) - objective > AS_WELL

    def normal(self, left: Array, place: Array) -> tuple[Array, Array]:
        """Return matrix and right side of the normal equations of a step, the prior included."""
        difference = DIFFERENCE_WHERE_IT_SWITCHES if self.switches else DIFFERENCE
        weights = 1 / (self.power(left) * self.problem.thresholds.provisional_autocorrelation_time)[self.wheel]
        rows = []
        for parameter in range(len(place)):
            aside = place.copy()
            aside[parameter] += difference
            change = (left - self.left(aside)) / difference
            rows.append(np.where(np.isfinite(change), change, 0.0))
        tangents = np.array(rows)
        return tangents * weights @ tangents.T + np.eye(len(place)), tangents * weights @ left - place


def _step(matrix: Array, slope: Array, moved: Mask) -> Array:
    """Return the step of the coordinates that are moved; 0 of the others."""
    step = np.zeros(len(slope))
    step[moved] = np.linalg.solve(matrix[np.ix_(moved, moved)], slope[moved])
    return step
