"""Sizes and shapes of a fleet's effects, with 90 % intervals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import Parameter
from regolithd.calibration.mismatch.fleet.choice.intervals import size_stds
from regolithd.calibration.mismatch.fleet.choice.selection import relative_size
from regolithd.calibration.mismatch.inference.uncertainty.intervals import OF_SIGN, unit_of
from regolithd.calibration.mismatch.problem.words import in_units
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit
    from regolithd.calibration.mismatch.fleet.work.grid import GridGroup

Array = NDArray[np.float64]

SLOPE_STEP = 1e-4
"""Step of a coefficient for the slope of the size, as a share of the largest (double precision)."""
LEAST_WEIGHT = 1e-300
"""Sum of the weights of coefficients that nothing tells, so that their mean is 0."""
ANY = (-np.inf, np.inf)
"""Bounds of what may have any value."""


@dataclass(frozen=True, eq=False)
class Law:
    """A shape, and the coefficients that an effect has with it, with their standard deviations."""

    shape: Shape
    sizes: Array
    spread: Array


def rms(squares: Array, counts: Array) -> float:
    """Return the root of the mean of squares, which are sums over so many readings."""
    return float(np.sqrt(max(float(squares.sum()), 0.0) / max(float(counts.sum()), 1.0)))


def mean_sizes(values: Array, stds: Array, count: int) -> tuple[Array, Array]:
    """Return an effect's `count` coefficients with standard deviations; of a size of each rover's, mean and spread.

    A coefficient that nothing tells is 0 with a standard deviation of 0, and is left out.
    """
    values, stds = values.reshape(-1, count), stds.reshape(-1, count)
    told = stds > 0
    weights = np.divide(1.0, stds**2, out=np.zeros(stds.shape), where=told)
    total = np.maximum(np.sum(weights, axis=0), LEAST_WEIGHT)
    mean = np.sum(weights * values, axis=0) / total
    spread = np.sqrt(np.sum((values - mean) ** 2, axis=0, where=told) / np.maximum(told.sum(axis=0), 1))
    return mean, _as_a_whole(mean, np.where(told.any(axis=0), np.maximum(1 / np.sqrt(total), spread), 0.0))


def _as_a_whole(sizes: Array, stds: Array) -> Array:
    """Return standard deviations of sizes with the share by which all of them are off, as in one recording."""
    return np.hypot(stds, THRESHOLDS.size_discrepancy_std * sizes)


def size_with_std(equations: FleetEquations, beside: FleetEquations, fit: FleetFit, index: int) -> tuple[float, float]:
    """Return a term's relative size and its standard deviation.

    That of all its coefficients, and of its shape, by the size's slope over each. With a size of each rover's, it is at
    least what these scatter by. `fit` is of the equations `beside` what single recordings show.
    """
    span, count = fit.spans[index], len(fit.terms[index].group.columns)
    values = fit.coefficients[span]
    step = SLOPE_STEP * max(float(np.max(np.abs(values))), 1e-300)
    slopes = np.zeros((1, len(fit.coefficients)))
    for place in np.arange(len(fit.coefficients))[span]:
        moved = [fit.coefficients.copy(), fit.coefficients.copy()]
        moved[0][place] -= step
        moved[1][place] += step
        less, more = (relative_size(equations, replace(fit, coefficients=each), index, 0.0) for each in moved)
        slopes[0, place] = (more - less) / (2 * step)
    size, std = relative_size(equations, fit, index, 0.0), float(size_stds(beside, fit, slopes)[0])
    group = fit.terms[index].group
    for name in () if group.of_wheels else _free(group):
        if (found := moved_law(beside, fit, index, name)) is not None:
            near = _nearest(beside, fit, index, name)[0]
            terms = (*fit.terms[:index], replace(fit.terms[index], group=near), *fit.terms[index + 1 :])
            by_shape = relative_size(equations, beside.fit(terms), index, 0.0) - size
            low, high = group.candidate.free[name]
            of_shape = min(found[1], (high - low) / np.sqrt(12))  # at most as of any value within the bounds
            std = float(np.hypot(std, by_shape / (float(near.shape[name]) - float(group.shape[name])) * of_shape))
    of_rovers = np.linalg.norm(values.reshape(-1, count), axis=1)
    scatter = float(np.std(of_rovers) / max(np.mean(of_rovers), 1e-300)) if fit.terms[index].units.each else 0.0
    return size, float(_as_a_whole(np.array(size), np.array(max(std, scatter * size))))


def told_sizes(group: GridGroup, values: Array, stds: Array) -> tuple[Array, Array]:
    """Return an effect's coefficients with standard deviations as its candidate has them: of wheels, or their mean."""
    count = len(group.columns)
    places = group.candidate.columns_of_wheels(group.shape, len(values) // count)
    if places is None:
        return mean_sizes(values, stds, count)
    found = np.zeros((2, len(values)))
    found[:, places.ravel()] = values, _as_a_whole(values, stds)
    return found[0], found[1]


def parameters_of(
    equations: FleetEquations, fit: FleetFit, stds: Array, index: int, unit: str, labels: Mapping[str, str]
) -> dict[str, Parameter]:
    """Return what a single recording's answer tells of an effect, by name: coefficients and shape parameters.

    A value is at the fit's own shape. Its interval holds that and where other shapes of the grid move it; it is not a
    number where none tells how the effect changes with the parameter.
    """
    group, span = fit.terms[index].group, fit.spans[index]
    candidate = group.candidate
    own = Law(group.shape, *told_sizes(group, fit.coefficients[span], stds[span]))
    moved = {name: None if group.of_wheels else moved_law(equations, fit, index, name) for name in _free(group)}
    wide = {name: np.nan if found is None else found[1] for name, found in moved.items()}
    laws = [own, *(found[0] for found in moved.values() if found is not None)]
    ranges = [_ranges(candidate, law, wide) for law in laws]
    units = {each.name: in_units(each.unit, unit, labels) for each in candidate.coefficients}
    limits = {each.name: OF_SIGN[each.sign] for each in candidate.coefficients if each.sign} | dict(candidate.free)
    found = {}
    for name, value in candidate.parameters(own.shape, own.sizes.tolist()).items():
        if name != candidate.change_point:
            ends = np.clip([value, *(end for each in ranges for end in each[name])], *limits.get(name, ANY))
            if name in own.shape and moved.get(name) is None:  # the grid has no other value of it
                ends = np.array([np.nan])
            told = units.get(name) or unit_of(name, labels)
            found[name] = Parameter(float(value), float(np.min(ends)), float(np.max(ends)), told)
    return found


def _ranges(candidate: Candidate, law: Law, wide: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return the 90 % interval of each parameter about a law; `wide` are the shape parameters' standard deviations."""

    def told(sizes: Array, **shape: float) -> dict[str, float]:
        return candidate.parameters({**law.shape, **shape}, sizes.tolist())

    centre = told(law.sizes)
    moved = [told(sizes) for sizes in law.sizes + np.diag(law.spread)]
    moved += [told(law.sizes, **{name: float(law.shape[name]) + std}) for name, std in wide.items()]
    reach = {
        name: NINETY_PERCENT_STDS * float(np.sqrt(sum((each[name] - at) ** 2 for each in moved)))
        for name, at in centre.items()
    }
    return {name: (at - reach[name], at + reach[name]) for name, at in centre.items()}


def moved_law(equations: FleetEquations, fit: FleetFit, index: int, name: str) -> tuple[Law, float] | None:
    """Return the law with a free shape parameter where the recordings have it, and its standard deviation.

    An effect of two shapes s and s', of sizes c and d, is to first order one of the shape s + (s' − s) d / (c + d) and
    of the size c + d. Of the shapes of the grid that differ in this parameter alone, that is taken of the nearest on
    either side which explains more beside the fit's own; None where there is none.
    """
    term, nearest = fit.terms[index], _nearest(equations, fit, index, name)
    if not nearest:
        return None
    both = max((equations.fit((*fit.terms, replace(term, group=each))) for each in nearest), key=_gained)
    own, other = term.group.shape, both.terms[-1].group.shape
    scale = _scale(term.group.candidate, other) / _scale(term.group.candidate, own)
    total = both.coefficients[both.spans[index]] + scale * both.coefficients[both.spans[-1]]
    energy = max(float(total @ total), 1e-300)
    share = scale * float(both.coefficients[both.spans[-1]] @ total) / energy
    stds = size_stds(equations, both, _along(both, index, total / energy, share, scale))
    at = float(own[name])
    step = float(other[name]) - at
    sizes = mean_sizes(total, stds[1:], len(term.group.columns))
    return Law({**own, name: at + share * step}, *sizes), abs(step) * float(stds[0])


def _nearest(equations: FleetEquations, fit: FleetFit, index: int, name: str) -> list[GridGroup]:
    """Return the nearest shape of the grid on either side that differs from a term's in one parameter alone."""
    term = fit.terms[index]
    others = [group for group in equations.groups if _differs_in(group, term.group, name)]
    at = float(term.group.shape[name]) if others else 0.0
    sides = ([each for each in others if (float(each.shape[name]) > at) is above] for above in (False, True))
    return [min(side, key=lambda each: abs(float(each.shape[name]) - at)) for side in sides if side]


def _along(both: FleetFit, index: int, total: Array, share: float, scale: float) -> Array:
    """Return how the share of the last term, and the size of each coefficient with it, change with all coefficients."""
    count = len(total)
    along = np.zeros((1 + count, len(both.coefficients)))
    own, added = both.spans[index], both.spans[-1]
    along[0, own], along[0, added] = -share * total, (1 - share) * scale * total
    along[1:, own], along[1:, added] = np.eye(count), scale * np.eye(count)
    return along


def _gained(fit: FleetFit) -> float:
    return fit.delta_chi2


def _scale(candidate: Candidate, shape: Shape) -> float:
    return float(shape.get(candidate.scaled_by, 1.0))


def _free(group: GridGroup) -> list[str]:
    """Return the shape parameters that are continuous; what begins within a recording is no shape of a fleet's."""
    return [name for name in group.shape if name in group.candidate.free and name != group.candidate.change_point]


def _differs_in(group: GridGroup, other: GridGroup, name: str) -> bool:
    """Return whether two shapes of a candidate differ in one parameter alone, beside their scale."""
    if group.candidate.name != other.candidate.name or name not in group.shape:
        return False
    left_out = {name, group.candidate.scaled_by}
    one, two = ({key: value for key, value in each.shape.items() if key not in left_out} for each in (group, other))
    return one == two and group.shape[name] != other.shape[name]
