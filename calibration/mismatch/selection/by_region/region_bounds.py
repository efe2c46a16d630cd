"""How sure a region's bounds are: the posterior over a grid of both, all coefficients profiled out.

Every place of a bound is as likely before the recording as any other. After it, the density is exp(Δχ² / 2), with Δχ²
divided by `OVERCONFIDENCE`: the form in the region is never exactly the true one. The estimate of a bound is its
median, the interval holds it nine times in ten.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.likelihood.as_read import as_read
from regolithd.calibration.mismatch.regression.products.range_sums import Ranges, known_values, range_sums
from regolithd.calibration.mismatch.selection.by_region.region_search import (
    FEWEST_SHARE,
    Found,
    between,
    edges_of,
    with_region,
)
from regolithd.calibration.mismatch.signal.density import quantiles

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.groups.region import Region
    from regolithd.calibration.mismatch.regression.likelihood.as_read import AsRead
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]

GRID = 40
"""Places of each bound (a choice)."""
WINDOW = 3
"""Half width of the first grid, in steps of the search (a choice: it is widened where it does not hold the density)."""
WIDENINGS = 4
"""Times that a grid is doubled at most."""
MOST_AT_THE_END = 0.02
"""Share of the density in the outermost places of a grid, from which on it is widened."""
OVERCONFIDENCE = 2.0
"""Factor by which Δχ² between bounds is too large (a choice: no form is exactly the true one)."""
QUANTILES = (0.05, 0.5, 0.95)
"""Of a bound: the ends of its 90 % interval, and its estimate."""


@dataclass(frozen=True)
class Bound:
    """A bound with its 90 % interval."""

    value: float
    low: float
    high: float


def bounds_of(equations: NormalEquations, fit: Fit, index: int) -> tuple[Bound | None, Bound | None]:
    """Return the lower and the upper bound of a region of a fit; None where it has none."""
    term = fit.terms[index]
    region = term.group.region
    assert region is not None  # noqa: S101  # only regions come here
    rest = as_read(equations, equations.fit(fit.without(index)))
    values = known_values(equations, region.covariate, region.coupling, term.wheels)
    steps = [_step(values, bound) for bound in (region.lower, region.upper)]
    for _ in range(WIDENINGS + 1):
        grids = [_grid(values, bound, step) for bound, step in zip((region.lower, region.upper), steps, strict=True)]
        density = _density(equations, rest, region, term.wheels, grids)
        ends = [density.sum(axis=1 - axis)[[0, -1]].max() if len(grid) else 0.0 for axis, grid in enumerate(grids)]
        if max(ends) < MOST_AT_THE_END:
            break
        steps = [2 * step if end >= MOST_AT_THE_END else step for step, end in zip(steps, ends, strict=True)]
    lower, upper = (_bound(grid, density.sum(axis=1 - axis)) for axis, grid in enumerate(grids))
    return lower, upper


def with_median_bounds(equations: NormalEquations, fit: Fit) -> tuple[NormalEquations, Fit]:
    """Return the fit with the estimates in the place of the bounds that the search found."""
    for index, term in enumerate(fit.terms):
        region = term.group.region
        if region is not None:
            lower, upper = bounds_of(equations, fit, index)
            moved = _moved(region, lower, upper)
            found = Found(0.0, moved, term.wheels, term.group.selection_penalty)
            equations, better = with_region(equations, found)
            fit = equations.fit((*fit.terms[:index], better, *fit.terms[index + 1 :]))
    return equations, fit


def _moved(region: Region, lower: Bound | None, upper: Bound | None) -> Region:
    """Return a region with other bounds, the distance still counted from the bound where there is one alone."""
    low = region.lower if lower is None else lower.value
    high = region.upper if upper is None else upper.value
    alone = low if upper is None else high
    origin = alone if upper is None or lower is None else 0.5 * (low + high)
    return replace(region, lower=low, upper=high, origin=origin)


def _step(values: Array, bound: float) -> float:
    """Return the spacing of the search's edges about a bound, times the window."""
    if not np.isfinite(bound):
        return 0.0
    edges = edges_of(values)
    at = int(np.clip(np.searchsorted(edges, bound), WINDOW, len(edges) - 1))
    return float(max(edges[min(at + WINDOW, len(edges) - 1)] - bound, bound - edges[at - WINDOW]))


def _grid(values: Array, bound: float, step: float) -> Array:
    """Return places of a bound: evenly spaced, as far as the covariate has values; none where there is no bound."""
    if not np.isfinite(bound):
        return np.zeros(0)
    low, high = (float(q) for q in np.quantile(values, (FEWEST_SHARE / 2, 1 - FEWEST_SHARE / 2)))
    return np.linspace(max(bound - step, low), min(bound + step, high), GRID)


def _density(
    equations: NormalEquations, rest: AsRead, region: Region, wheels: tuple[int, ...], grids: list[Array]
) -> Array:
    """Return the posterior of both bounds, shape (lower, upper); one row or column where there is no bound."""
    edges = np.unique(np.concatenate(grids))
    sums = range_sums(equations, rest, region.covariate, region.coupling, wheels, edges)
    ranges = between(edges, *grids)
    ordered = ranges.first < ranges.last
    gains = np.full(len(ordered), -np.inf)
    gains[ordered] = sums.delta_chi2(Ranges(ranges.first[ordered], ranges.last[ordered]), [region.powers])[0]
    density = np.exp((gains - gains.max()) / (2 * OVERCONFIDENCE)).reshape([max(len(grid), 1) for grid in grids])
    return np.asarray(density / density.sum())


def _bound(grid: Array, density: Array) -> Bound | None:
    """Return the median and the 90 % interval of a density on a grid."""
    if not len(grid):
        return None
    low, value, high = quantiles(grid, density, QUANTILES)
    half_step = 0.5 * float(grid[1] - grid[0])
    return Bound(value, low - half_step, high + half_step)
