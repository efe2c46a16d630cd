"""Sums of products over ranges of a covariate: the Δχ² of a polynomial in any range, from one pass over the rows.

The rows are sorted into narrow bins of the covariate. For each bin the sums of the powers' products with each other,
with the columns of a fit, and with what the fit leaves are added up from the lowest bin on; a range's sums are then
the difference of two of them, and the coefficients of everything else in the fit are profiled out by the Schur
complement (`regression.schur`).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.groups.region import HIGHEST_POWER, Region
from regolithd.calibration.mismatch.regression.groups.smooth_groups import acting

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.likelihood.as_read import AsRead
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]
Index = NDArray[np.int64]

NARROWEST_CURVE = 0.04
"""Width below which only a step, growth or a line is fitted, as a share of the covariate's whole range (a choice:
differences of sums lose the digits that higher powers in narrower ranges need)."""

SINGULAR = 1e-5
"""Eigenvalue, of columns of energy 1, below which a direction counts as undetermined: rounding in narrow ranges."""


@dataclass(frozen=True, eq=False)
class Ranges:
    """Ranges between edges: from edge `first` to edge `last`, 0 and the number of edges + 1 being no bound."""

    first: Index
    last: Index


@dataclass(frozen=True, eq=False)
class RangeSums:
    """Sums up to each edge, powers being those of the scaled covariate (value − centre) / half.

    Attributes
    ----------
    covariate, coupling: what is bounded, and how the polynomials act
    edges: increasing values of the covariate, shape (edge,)
    low, high: the covariate's extremes
    readings: shape (edge + 2,)
    own: weighted sums of factor² × power, up to twice the highest, shape (edge + 2, power)
    left: of factor × power × what the fit leaves, shape (edge + 2, power)
    cross: of factor × power × column of the fit, shape (edge + 2, power, column)
    covariance: of the fit's coefficients, shape (column, column)
    """

    covariate: str
    coupling: str
    edges: Array
    low: float
    high: float
    readings: Array
    own: Array
    left: Array
    cross: Array
    covariance: Array

    def delta_chi2(self, ranges: Ranges, forms: Sequence[tuple[int, ...]]) -> list[Array]:
        """Return the Δχ² of polynomials with the powers of each form in each range, shape (range,) each."""
        moment, complement = self._beside_fit(ranges)
        width = self._bound(ranges.last, self.high) - self._bound(ranges.first, self.low)
        too_narrow = width < NARROWEST_CURVE * (self.high - self.low)
        found = []
        for powers in forms:
            at = np.array(powers)
            gains = self._together(moment[:, at], complement[:, at[:, None], at])
            found.append(np.where(too_narrow, 0.0, gains) if max(powers) > 1 else gains)
        return found

    def _beside_fit(self, ranges: Ranges) -> tuple[Array, Array]:
        """Return moments (range, power) and Schur complements (range, power, power), columns scaled to energy 1."""
        first, last = ranges.first, ranges.last
        own, cross, left = (sums[last] - sums[first] for sums in (self.own, self.cross, self.left))
        local = self._local(ranges)
        powers = np.arange(HIGHEST_POWER + 1)
        energy = local @ own[:, powers[:, None] + powers] @ np.swapaxes(local, 1, 2)
        fitted = local @ cross
        complement = energy - (fitted @ self.covariance) @ np.swapaxes(fitted, 1, 2)
        squares = np.einsum("nkk->nk", energy)
        # What a range without readings has is rounding.
        some = (self.readings[last] > self.readings[first])[:, None] & (squares > 0)
        scale = np.where(some, 1 / np.sqrt(np.where(some, squares, 1.0)), 0.0)
        moment = np.einsum("nkj,nj->nk", local, left) * scale
        return moment, complement * scale[:, :, None] * scale[:, None, :]

    def _together(self, moment: Array, complement: Array) -> Array:
        """Return the Δχ² of columns together; nearly undetermined directions are left out."""
        values, vectors = np.linalg.eigh(complement)
        along = np.einsum("nkj,nk->nj", vectors, moment)
        kept = values > SINGULAR
        return np.asarray(np.sum(np.where(kept, along**2 / np.where(kept, values, 1.0), 0.0), axis=1))

    def region(self, first: int, last: int, powers: tuple[int, ...]) -> Region:
        """Return one range as a region."""
        at = Ranges(np.array([first]), np.array([last]))
        origin, width = self._origin(at)
        return Region(
            covariate=self.covariate,
            coupling=self.coupling,
            lower=float(self._bound(at.first, -np.inf)[0]),
            upper=float(self._bound(at.last, np.inf)[0]),
            powers=powers,
            origin=float(origin[0]),
            width=float(width[0]),
        )

    def share(self, ranges: Ranges) -> Array:
        """Return the share of the readings in each range."""
        return np.asarray((self.readings[ranges.last] - self.readings[ranges.first]) / max(self.readings[-1], 1.0))

    def _bound(self, place: Index, beyond: float) -> Array:
        """Return the edges at these places; `beyond` where there is no bound."""
        inside = (place > 0) & (place <= len(self.edges))
        return np.where(inside, self.edges[np.clip(place - 1, 0, len(self.edges) - 1)], beyond)

    def _origin(self, ranges: Ranges) -> tuple[Array, Array]:
        """Return where the distance is counted from, and its scale: the bound where there is one alone."""
        lower, upper = self._bound(ranges.first, self.low), self._bound(ranges.last, self.high)
        open_below, open_above = ranges.first == 0, ranges.last == len(self.edges) + 1
        one_bound = np.where(open_below, upper, lower)
        middle = 0.5 * (lower + upper)
        width = np.maximum(upper - lower, 1e-12 * (self.high - self.low))
        return np.where(open_below == open_above, middle, one_bound), width

    def _local(self, ranges: Ranges) -> Array:
        """Return the powers of the distance in a range as sums of powers of the scaled covariate, (range, k, j)."""
        centre, half = _scaling(self.low, self.high)
        origin, width = self._origin(ranges)
        shift, factor = (origin - centre) / half, half / width
        found = np.zeros((len(shift), HIGHEST_POWER + 1, HIGHEST_POWER + 1))
        for k in range(HIGHEST_POWER + 1):
            for j in range(k + 1):
                found[:, k, j] = comb(k, j) * (-shift) ** (k - j) * factor**k
        return found


def _scaling(low: float, high: float) -> tuple[float, float]:
    return 0.5 * (low + high), 0.5 * (high - low) or 1.0


def known_values(equations: NormalEquations, covariate: str, coupling: str, wheels: Sequence[int]) -> Array:
    """Return the covariate's values where it is known and compared on some wheels, shape (reading,)."""
    problem, on = equations.problem, list(wheels)
    values, _ = acting(problem, covariate, coupling)
    return np.asarray(values[:, on][problem.mask[:, on] & np.isfinite(values[:, on])])


def range_sums(
    equations: NormalEquations, read: AsRead, covariate: str, coupling: str, wheels: Sequence[int], edges: Array
) -> RangeSums:
    """Sum over the bins between edges, on some wheels, beside a fit to the readings as they were read."""
    course = acting(equations.problem, covariate, coupling)
    return sums_over_ranges(equations, read, (covariate, coupling), course, wheels, edges)


def sums_over_ranges(
    equations: NormalEquations,
    read: AsRead,
    named: tuple[str, str],
    course: tuple[Array, Array],
    wheels: Sequence[int],
    edges: Array,
) -> RangeSums:
    """Sum the same of any course: a covariate's values, and a factor by which they act, shape (time, wheel) each."""
    fit = read.fit
    problem, design = equations.problem, equations.design
    values, factor = (each[design.order] for each in course)
    mask = problem.mask[design.order] & np.isfinite(values)
    on = list(wheels)
    inside = values[:, on][mask[:, on]]
    low, high = float(inside.min()), float(inside.max())
    centre, half = _scaling(low, high)
    bins, powers = len(edges) + 1, HIGHEST_POWER + 1
    readings, own = np.zeros(bins), np.zeros((bins, 2 * powers - 1))
    moment, cross = np.zeros((bins, powers)), np.zeros((bins, powers, len(fit.columns)))
    for w in on:
        rows = np.flatnonzero(mask[:, w])
        at = np.searchsorted(edges, values[rows, w], side="right")
        scaled, acts, weight = (values[rows, w] - centre) / half, factor[rows, w], read.weights[w]
        readings += np.bincount(at, minlength=bins)
        column = [weight * acts]
        for _ in range(2 * powers - 2):
            column.append(column[-1] * scaled)
        own += np.stack([np.bincount(at, acts * each, bins) for each in column], axis=1)
        column = column[:powers]
        known = read.residual[w, rows]
        moment += np.stack([np.bincount(at, each * known, bins) for each in column], axis=1)
        for c, (_, of_column) in enumerate(fit.columns):
            if w in of_column:
                fitted = read.columns[c, w, rows]
                cross[:, :, c] += np.stack([np.bincount(at, each * fitted, bins) for each in column], axis=1)
    return RangeSums(
        covariate=named[0],
        coupling=named[1],
        edges=edges,
        low=low,
        high=high,
        readings=_up_to(readings),
        own=_up_to(own),
        left=_up_to(moment - cross @ read.fit.coefficients),
        cross=_up_to(cross),
        covariance=read.fit.covariance,
    )


def _up_to(of_bins: Array) -> Array:
    """Return cumulative sums, from nothing to everything."""
    return np.concatenate((np.zeros((1, *of_bins.shape[1:])), np.cumsum(of_bins, axis=0)))
