"""Optimisation of shape parameters between the grid's points: an onset to the second, a Stribeck speed, an order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import columns_of
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.groups.candidate_groups import (
    coefficient_signs,
    cost_of_unusual_numbers,
    with_candidate,
)
from regolithd.calibration.mismatch.regression.normal_equations import membership
from regolithd.calibration.mismatch.regression.screening.schur import delta_chi2_together, schur_complement

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.regression.design_matrix import Course
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]
Single = NDArray[np.float32]

Point = tuple[float, float]
"""Argument and value of a function."""

GOLDEN_RATIO = (5**0.5 - 1) / 2
SCAN_POINTS = 7
CLOSEST = 1 / 840
"""Share of the interval around the best of a scan to which a shape parameter is narrowed down (a choice: far less than
its standard error)."""
MOST_STEPS = 30
"""Steps of that, at most; most take five."""
MOST_EVALUATIONS = 150
"""Of the search for several numbers together (a choice: two take 40 to 60)."""
FURTHEST = 4.0
"""Factor by which a number of a shape may be extrapolated (a choice)."""
NEAR = 3
"""Readings about an onset at which another development is tried too (a choice)."""
MISFORESEEN = 0.5
"""Share of a parabola's gain by which a smooth function may differ from it (a choice: it shrinks with each step)."""
LEAST_GAIN = 0.05
"""Gain of Δχ² below which that is no matter (a choice: a fifth of a standard error gains so much)."""


@dataclass(frozen=True, eq=False)
class ShapeProfile:
    """The Δχ² of one candidate on some wheels as a function of its shape, with other terms in the fit.

    Attributes
    ----------
    equations, candidate: what is asked
    course: the readings of the wheels that are asked for
    weights: the square root of each reading's weight, 0 in folds that the equations leave out, shape (reading,)
    inverse: of the other terms' normal equations
    fitted: the other terms' columns, weighted, shape (column, reading)
    left: what they leave of the residual, weighted, shape (reading,)
    """

    equations: NormalEquations
    candidate: Candidate
    course: Course
    weights: Single
    inverse: Array
    fitted: Single
    left: Single

    def along(self, shape: Shape, name: str) -> Callable[[float], float]:
        """Return Δχ², less what the shape must gain by its prior, as a function of one shape parameter."""
        return lambda value: self.less_prior({**shape, name: value})

    def less_prior(self, shape: Shape) -> float:
        """Return the further Δχ² less what the shape must gain by its prior, and by another channel's evidence."""
        prior = self.candidate.prior_penalty(self.equations.problem, shape)
        return self(shape) - prior - self._unlike_own_channel(shape)

    def __call__(self, shape: Shape) -> float:
        """Return the further Δχ²."""
        moment, complement, own = self._sums(shape)
        return delta_chi2_together(
            moment,
            complement,
            float(np.max(np.diag(own))),
            coefficient_signs(self.candidate, len(own)),
            self.equations.thresholds.least_tolerance,
        )

    def at(self, shape: Shape, coefficient: float, relative_std: float) -> float:
        """Return the further Δχ² of a shape's one column whose coefficient has this prior, and is not beyond it.

        Noise of inputs makes a coefficient smaller, never larger.
        """
        (moment,), ((complement,),), _ = self._sums(shape)
        prior = 1 / relative_std**2
        along, energy = coefficient * moment, coefficient**2 * complement
        share = min((along + prior) / (energy + prior), 1.0)
        return float(2 * share * along - share**2 * energy - prior * (share - 1) ** 2)

    def _unlike_own_channel(self, shape: Shape) -> float:
        """Return by how much a coefficient is improbable that another channel's fault has in the predicted one.

        Its ratio to the one that the other channel shows is distributed log-normally about 1, and within its limits in
        two standard deviations.
        """
        evidence, limits = self.candidate.own_channel_evidence(self.equations.problem, shape), self.equations.thresholds
        if evidence is None:
            return 0.0
        (moment,), ((complement,),), _ = self._sums(shape)
        own = float(evidence[1][self.course.wheel[0]])
        ratio = moment / max(complement, 1e-300) / own
        three_stds = np.log(limits.own_channel_ratio_high)
        return float((3 * np.log(ratio) / three_stds) ** 2) if ratio > 0 else float("inf")

    def rows(self, columns: Array) -> Single:
        """Return columns (column, time, wheel), whitened and weighted, shape (column, reading)."""
        return self.course.whitened(columns) * self.weights

    def sums(self, rows: Single) -> tuple[Array, Array, Array]:
        """Return moments of `rows`, their products beside the other terms, and all their products."""
        cross = (rows @ self.fitted.T).astype(np.float64)
        own = (rows @ rows.T).astype(np.float64)
        return (rows @ self.left).astype(np.float64), schur_complement(own, cross.T, self.inverse), own

    def _sums(self, shape: Shape) -> tuple[Array, Array, Array]:
        problem, candidate = self.equations.problem, self.candidate
        # The same shapes are tried again beside other terms.
        columns = problem.lately(tuple(shape.items()), lambda: columns_of(problem, candidate, shape), candidate)
        return self.sums(self.rows(columns))


def shape_profile(
    equations: NormalEquations, others: Sequence[Term], candidate: Candidate, wheels: tuple[int, ...]
) -> ShapeProfile:
    """Fit the other terms and return the candidate's profile beside them."""
    design, fitted, course = equations.design, equations.fit(others), equations.design.course_of(wheels)
    columns = course.arranged(design.columns([column for column, _ in fitted.columns]))
    columns *= membership(fitted.columns, len(equations.weights)).astype(np.float32)[:, course.wheel]
    residual = course.arranged(design.residual) - fitted.coefficients @ columns
    in_fit = np.isin(np.searchsorted(design.cuts, course.place, side="right") - 1, equations.folds)
    weights = np.where(in_fit, np.sqrt(equations.weights)[course.wheel], 0.0).astype(np.float32)
    return ShapeProfile(
        equations=equations,
        candidate=candidate,
        course=course,
        weights=weights,
        inverse=fitted.covariance,
        fitted=columns * weights,
        left=(residual * weights).astype(np.float32),
    )


def optimised_shape(equations: NormalEquations, others: Sequence[Term], term: Term) -> tuple[NormalEquations, Term]:
    """Return the term with its free shape parameters at the largest Δχ², and equations that have its columns."""
    candidate = term.group.candidate
    if candidate is None:
        return equations, term
    if not any(name in term.group.shape for name in (*candidate.free, *candidate.refined)):
        return _self_consistent(equations, others, term)
    if candidate.stated_coefficient(term.group.shape) is not None:
        return _at_its_coefficient(equations, others, term, candidate)
    profile = shape_profile(equations, others, candidate, term.wheels)
    best, gain = _with_free_at_best(profile, dict(term.group.shape))
    best = _refined(profile, best, gain)
    equations, term = _reshaped(equations, term, best)
    return _self_consistent(equations, others, term)


def _with_free_at_best(profile: ShapeProfile, shape: Shape) -> tuple[Shape, float]:
    """Return a shape with each free number in turn at the largest Δχ² less its prior's, and that Δχ²."""
    problem, candidate = profile.equations.problem, profile.candidate
    return _at_best(profile, shape, candidate.bounds(problem, shape))


def _at_best(profile: ShapeProfile, shape: Shape, ranges: Mapping[str, tuple[float, float]]) -> tuple[Shape, float]:
    """Return a shape with each number that has a range, in turn, at the largest Δχ² less its prior's, and that Δχ²."""
    best, gain = shape, profile.less_prior(shape)
    for name, bounds in ranges.items():
        if name in best:
            between = profile.candidate.search_range(profile.equations.problem, best, name, bounds)
            value, found = maximise(profile.along(best, name), *between)
            if found > gain:
                best, gain = {**best, name: value}, found
    return best, gain


def _refined(profile: ShapeProfile, shape: Shape, gain: float) -> Shape:
    """Return a shape with other numbers than usual ones where these gain more than the choice among shapes by chance.

    All of its numbers are optimised together then: an exponent and a speed make up for each other.
    """
    problem, candidate = profile.equations.problem, profile.candidate
    ranges = candidate.refinable(problem, shape)
    other, reached = _at_best(profile, shape, ranges)
    if reached - gain < LEAST_GAIN:
        return shape
    ends = {**candidate.bounds(problem, shape), **ranges}
    other, reached = _together_at_best(profile, other, {name: ends[name] for name in ends if name in shape})
    return other if reached - gain > cost_of_unusual_numbers(problem, candidate, other) else shape


def _together_at_best(
    profile: ShapeProfile, shape: Shape, ranges: Mapping[str, tuple[float, float]]
) -> tuple[Shape, float]:
    """Return a shape with all numbers that have a range at the largest Δχ² less its prior's, and that Δχ² (simplex)."""
    from scipy.optimize import minimize  # noqa: PLC0415  # only where a recording demands unusual numbers

    def of(point: Array) -> Shape:
        return {**shape, **dict(zip(ranges, point.tolist(), strict=True))}

    start = np.array([float(shape[name]) for name in ranges])
    found = minimize(
        lambda point: -profile.less_prior(of(point)),
        start,
        method="Nelder-Mead",
        bounds=list(ranges.values()),
        options={"fatol": LEAST_GAIN, "xatol": np.inf, "maxfev": MOST_EVALUATIONS},
    )
    return of(np.asarray(found.x)), -float(found.fun)


def with_best_developments(
    equations: NormalEquations, terms: Sequence[Term]
) -> tuple[NormalEquations, tuple[Term, ...]]:
    """Return the terms, each that begins at a time with the development that explains most, at its own best onset.

    At the onsets of the grid a step may be behind a rise that begins earlier, and be ahead of it at its own onset.
    """
    found = list(terms)
    for index, term in enumerate(terms):
        equations, found[index] = _best_developed(equations, found[:index] + found[index + 1 :], term)
    return equations, tuple(found)


def _best_developed(equations: NormalEquations, others: Sequence[Term], term: Term) -> tuple[NormalEquations, Term]:
    """Return a term in its best development beside others; as it is where it begins at no time, or at a known one."""
    candidate, shape, problem = term.group.candidate, term.group.shape, equations.problem
    if candidate is None or (onset := candidate.change_point) not in shape:
        return equations, term
    if onset not in candidate.bounds(problem, shape):
        return equations, term
    profile = shape_profile(equations, others, candidate, term.wheels)
    best, gain = shape, profile.less_prior(shape) - cost_of_unusual_numbers(problem, candidate, shape)
    for development in candidate.developments(problem):
        tried = {**development, onset: shape[onset]}
        between = candidate.search_range(problem, tried, onset, candidate.bounds(problem, tried)[onset])
        along = profile.along(tried, onset)
        # A steep rise begins within a few readings of a step, which the scan's points may step over.
        near = np.clip(float(shape[onset]) + problem.recording.step_s * np.arange(-NEAR, NEAR + 1), *between).tolist()
        value, reached = max((maximise(along, *between), *((at, along(at)) for at in near)), key=lambda pair: pair[1])
        if reached > gain:
            best, gain = {**tried, onset: value}, reached
    return _reshaped(equations, term, best)


def _at_its_coefficient(
    equations: NormalEquations, others: Sequence[Term], term: Term, candidate: Candidate
) -> tuple[NormalEquations, Term]:
    """Return the term in the shape, of any kind that states its coefficient, that has the largest Δχ² beside that.

    Kinds have other free parameters, and the same words.
    """
    problem, profile = equations.problem, shape_profile(equations, others, candidate, term.wheels)

    def gain(shape: Shape) -> float:
        stated = candidate.stated_coefficient(shape)
        return -float("inf") if stated is None else profile.at(shape, *stated)

    def along(shape: Shape, name: str) -> Callable[[float], float]:
        return lambda value: gain({**shape, name: value})

    kinds: dict[frozenset[str], tuple[float, Shape]] = {}
    words = {name: value for name, value in term.group.shape.items() if isinstance(value, str)}
    own = {name: value for name, value in term.group.shape.items() if name in words or name in candidate.free}
    for shape in (own, *(each for each in candidate.shapes(problem) if words.items() <= each.items())):
        kind, found = frozenset(shape), gain(shape)
        if found > kinds.get(kind, (-float("inf"), shape))[0]:
            kinds[kind] = found, shape
    for kind, (_, shape) in kinds.items():
        for name in kind & set(candidate.free):
            between = candidate.search_range(problem, shape, name, candidate.bounds(problem, shape)[name])
            value, found = maximise(along(shape, name), *between)
            kinds[kind] = found, {**shape, name: value}
    best = max(kinds.values(), key=lambda pair: pair[0])[1]
    equations, term = _reshaped(equations, term, best)
    fit = equations.fit((*others, term))
    (value,) = fit.coefficients[fit.of_term(len(others))] / equations.design.scale[list(term.group.columns)]
    return _reshaped(equations, term, candidate.shape_at(best, float(value)))


def _self_consistent(equations: NormalEquations, others: Sequence[Term], term: Term) -> tuple[NormalEquations, Term]:
    """Return the term with a shape that agrees with its coefficients, as far as a few steps lead there."""
    tried: list[tuple[float, float]] = []
    for _ in range(equations.thresholds.self_consistency_steps):
        if (candidate := term.group.candidate) is None:
            break
        fit = equations.fit((*others, term))
        scale = equations.design.scale[list(term.group.columns)]
        values = fit.coefficients[fit.of_term(len(others))] / scale
        shape = candidate.self_consistent_shape(equations.problem, term.group.shape, values.tolist())
        if shape == term.group.shape:
            break
        equations, term = _reshaped(equations, term, _extrapolated(term.group.shape, shape, tried))
    return equations, term


def _extrapolated(before: Shape, asked: Shape, tried: list[tuple[float, float]]) -> Shape:
    """Return the shape at which the one number that was asked for would be the number asked for (secant method).

    Parameters
    ----------
    before, asked: the shape that was fitted, and the shape that its coefficients ask for
    tried: that number before and as asked for, of each step; this one is appended
    """
    changed = [name for name, value in asked.items() if before.get(name) != value]
    if len(changed) != 1 or changed[0] not in before:
        return asked
    name = changed[0]
    tried.append((float(before[name]), float(asked[name])))
    if len(tried) == 1:
        return asked
    (first, of_first), (last, of_last) = tried[-2:]
    lead, towards = of_last - last, (of_first - first) - (of_last - last)
    steps = (last - first) / towards if towards else 0.0
    low, high = sorted((last / FURTHEST, last * FURTHEST))
    return {**asked, name: min(max(last + steps * lead, low), high)} if steps > 0 else asked


def _reshaped(equations: NormalEquations, term: Term, shape: Shape) -> tuple[NormalEquations, Term]:
    """Return the term in another shape, and equations that have its columns."""
    candidate = term.group.candidate
    if candidate is None or shape == term.group.shape:
        return equations, term
    design, (group,) = with_candidate(equations.design, candidate, [shape], [term.group.noise_reduction])
    return equations.over(design), Term(group, term.wheels)


def maximise(function: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Return argument and value of the largest of a coarse scan, then of parabolas around it.

    `scipy.optimize.minimize_scalar` has no scan before its bounded search, and does not start from what was scanned.
    """
    points = np.linspace(low, high, SCAN_POINTS).tolist()
    values = [function(x) for x in points]
    top = int(np.argmax(values))
    bracket = [(points[k], values[k]) for k in (max(top - 1, 0), top, min(top + 1, SCAN_POINTS - 1))]
    return peak_within(function, *bracket)


def peak_within(function: Callable[[float], float], left: Point, best: Point, right: Point) -> Point:
    """Return the maximum between two points, from one of them or between them that is at least as high as both.

    Parabolas through the three while they halve what is left and foresee the values (Brent, 1973, chapter 5), else
    golden sections: the gain of an onset has a kink at each reading.
    """
    closest, widths, smooth = (right[0] - left[0]) * CLOSEST, [float("inf")] * 2, True
    for _ in range(MOST_STEPS):
        before, after = best[0] - left[0], right[0] - best[0]
        if max(before, after) <= closest * (1 + 1e-9):
            break
        halves = before + after <= widths[-2] / 2
        widths.append(before + after)
        vertex = _vertex(left, best, right) if smooth and halves and min(before, after) > 0 else None
        golden = (1 - GOLDEN_RATIO) * (after if after > before else -before)
        step = vertex[0] if vertex else golden
        if min(before, after) <= 0 or abs(step) < closest:  # an end of the range, or all but found
            step = closest if after > before else -closest
        new = best[0] + step, function(best[0] + step)
        if vertex and step == vertex[0]:
            smooth = abs(new[1] - best[1] - vertex[1]) <= MISFORESEEN * max(vertex[1], LEAST_GAIN)
        if new[1] > best[1]:
            left, best, right = (best, new, right) if step > 0 else (left, new, best)
        else:
            left, right = (left, new) if step > 0 else (new, right)
    return best


def _vertex(left: Point, best: Point, right: Point) -> Point | None:
    """Return the way from the best of three points to their parabola's vertex, and the gain; None: none is between."""
    before, after = best[0] - left[0], right[0] - best[0]
    falls = (best[1] - left[1]) / before, (best[1] - right[1]) / after
    if not 0 < sum(falls) < float("inf"):  # level, or a value that is not finite
        return None
    step = (falls[0] * after - falls[1] * before) / (2 * sum(falls))
    curvature = sum(falls) / (before + after)
    return (step, curvature * step**2) if -before < step < after else None
