"""Starting values: where the fit of the parameters begins if their priors are too wide for tangents at the stated ones.

A parameter that is stated as 0 ± 2 has no value yet. There a product has no tangent, an exponential or a saturation has
a misleading one, and the residual is nearly all misfit, so that the noise seems large. So the sum of squares of the
simulation itself is searched from several places of the prior (multi-start), with the noise that is left at each.

The objective is −2 log of the posterior density with the unknown variance of each wheel's noise at its maximum
(concentrated likelihood):

    Σ over wheels  n / τ · ln(mean square of the residual)  +  Σ over parameters  ((value − stated) / std)²

with n readings of the wheel, and the provisional autocorrelation time τ, as the noise is not known yet. It is minimised
by Levenberg and Marquardt's method (Marquardt, 1963).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.calibration.step import Step
from regolithd.calibration.mismatch.candidates.sensor_delay import as_shown
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.inference.statements import after_number
from regolithd.calibration.mismatch.problem.principal_axes import switches

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.prior import Prior
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

DRAWS = 32
"""Places of the prior at which the simulation is run (a choice: five parameters, each above or below its stated value).
"""
ASKED = 4
"""Of these, places at which the tangents at the stated values are compared with the simulation (a choice)."""
SEARCHES = 4
"""Searches from the best of those places, beside the one from the stated values (a choice of cost)."""
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
class Start:
    """Where the fit begins.

    Attributes
    ----------
    problem: at the stated values
    values: the parameters'; None: the stated ones
    others: further values that fit the recording as well
    """

    problem: Problem
    values: Mapping[str, float] | None = None
    others: tuple[Mapping[str, float], ...] = ()

    def notes(self, problem: Problem, added: Array) -> tuple[str, ...]:
        """Return what to tell of other values that fit as well, beside what was found.

        `problem` is linearised where that was, and `added` is what it adds to the prediction, shape (time, wheel).
        """
        search = _Search.of(replace(problem, measured=problem.measured - added))
        with np.errstate(all="ignore"):
            found = [search.minimum(search.place(values)) for values in (problem.values, *self.others)]
            (least, _), *_ = found
            kept = [place for objective, place in search.apart(found)[1:] if abs(objective - least) < AS_WELL]
        priors = problem.simulation.parameters
        return tuple(
            f"Other values of the parameters fit the recording as well: {_listed(search.values(place), priors)}. A "
            f"narrower prior of one of them tells which are meant."
            for place in kept
        )


def starting_values(problem: Problem) -> Start:
    """Return the parameters' values where the simulation itself fits best.

    They are the stated ones where no parameter is as good as unknown, and where the tangents hold all over the prior.
    """
    search = _Search.of(problem)
    if not (search.is_wide or search.switches):
        return Start(problem)
    places = search.draws()
    steps = [Step(problem, search.values(place)) for place in places[:ASKED]]
    if not any(step.is_bent() or not step.is_defined for step in steps):
        return Start(problem)
    with np.errstate(all="ignore"):  # a prediction may overflow on the way
        ranked = sorted(places, key=lambda place: search.objective(search.left(place), place))
        begun = (np.zeros(len(search.names)), *ranked[:SEARCHES])
        found = sorted((search.minimum(place) for place in begun), key=lambda one: one[0])
        best, *others = [place for objective, place in search.apart(found) if objective - found[0][0] < AS_WELL]
    return Start(problem, search.values(best), tuple(search.values(place) for place in others))


def fitted_where_late(problem: Problem) -> tuple[dict[str, float], tuple[str, float]]:
    """Return the parameters' values and the delay with which the simulation fits best, the predicted channel late.

    The search begins at the problem's values and delay: those that were fitted without it stand for a part of it.
    """
    found = _Search.of(problem)
    search = _LateSearch(problem, found.names, found.wheel)
    with np.errstate(all="ignore"):  # a prediction may overflow on the way
        _, place = search.minimum(search.place(problem.values))
    return search.values(place), search.late(place)


def _listed(values: Mapping[str, float], priors: Mapping[str, Prior]) -> str:
    """Return parameters with their values and units."""
    free = {name: value for name, value in values.items() if priors[name].std > 0 and priors[name].told}
    return ", ".join(f"{name} {value:.4g}{after_number(priors[name].unit)}" for name, value in free.items())


@dataclass(frozen=True, eq=False)
class _Search:
    """The search of a problem. A place is in the priors' standard deviations from the stated values."""

    problem: Problem
    names: tuple[str, ...]
    wheel: NDArray[np.int64]

    @classmethod
    def of(cls, problem: Problem) -> _Search:
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

    def draws(self) -> list[Array]:
        """Return places that fill the prior evenly (Sobol, 1967), always the same ones."""
        # Importing it takes half a second, which a simulation with known parameters need not wait.
        from scipy.stats import qmc  # noqa: PLC0415

        uniform = qmc.Sobol(len(self.names), scramble=False).random(2 * DRAWS)[1 : DRAWS + 1]
        normal = np.vectorize(NormalDist().inv_cdf)(uniform)
        return [self.within(place) for place in normal]

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

    def minimum(self, place: Array) -> tuple[float, Array]:
        """Return the least objective that a search from a place finds, and where."""
        left = self.left(place)
        best, damping = self.objective(left, place), FIRST_DAMPING
        for _ in range(ITERATIONS if np.isfinite(best) else 0):
            matrix, slope = self.normal(left, place)
            before = best
            while damping < MOST_DAMPING:
                step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), slope)
                tried = self.within(place + step)
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


class _LateSearch(_Search):
    """The same of a problem whose predicted channel is late. The delay's share of change is the last coordinate."""

    def late(self, place: Array) -> tuple[str, float]:
        """Return how, and by how much, the channel is late at a place."""
        assert self.problem.late is not None  # noqa: S101  # a search of late problems alone
        kind, delay = self.problem.late
        return kind, delay * (1 + float(place[-1]))

    def values(self, place: Array) -> dict[str, float]:
        """Return the parameters' values at a place."""
        return super().values(place[:-1])

    def place(self, values: Mapping[str, float]) -> Array:
        """Return the place of the parameters' values with the delay of the problem."""
        return np.append(super().place(values), 0.0)

    def within(self, place: Array) -> Array:
        """Return a place as far as the parameters may be moved, and the delay to its half or its double."""
        found = super().within(place)
        found[-1] = np.clip(place[-1], -0.5, 1.0)
        return found

    def left(self, place: Array) -> Array:
        """Return what the simulation leaves of the readings there, shown as late as they are, shape (reading,)."""
        problem = replace(self.problem, late=self.late(place))
        try:
            (shown,) = as_shown(problem, [problem.changed(**self.values(place))])
        except SimulationError:
            return np.full(len(self.wheel), np.nan)
        return np.asarray((problem.measured - shown)[problem.mask])
