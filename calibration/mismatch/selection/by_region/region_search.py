"""The best regions beside a fit: over the covariates of significant smooth terms, one region after the other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.group import Group, Term
from regolithd.calibration.mismatch.regression.groups.lagged_groups import WITHOUT_CURVE
from regolithd.calibration.mismatch.regression.groups.region import FORMS, GROWTH, Region
from regolithd.calibration.mismatch.regression.groups.smooth_groups import acting, is_constant
from regolithd.calibration.mismatch.regression.likelihood.as_read import as_read
from regolithd.calibration.mismatch.regression.products.range_sums import Ranges, known_values, range_sums
from regolithd.calibration.mismatch.regression.residuals import chi2_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.likelihood.as_read import AsRead
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.regression.products.range_sums import RangeSums

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Forms = tuple[tuple[int, ...], ...]

FIRST_FORMS: tuple[Forms, ...] = (FORMS[:1], FORMS[:3])
"""Forms that regions are first looked for with: steps alone; steps, growth and lines."""

EDGES = 48
"""Quantiles, and as many even steps, at which a region may begin or end in the search (a choice: refined later)."""
FEWEST_SHARE = 0.01
"""Share of the readings that must be in a region, and outside of it (a choice: as `smooth_term_power`)."""
MOST_REGIONS = 3
"""Regions at most (a choice: computing time)."""
CURVES_TRIED = 3
"""Smooth terms over whose covariates a region is looked for (a choice: computing time)."""
REFINED = 3
"""Ranges of one covariate whose bounds are refined (a choice: computing time)."""
REFINED_PLACES, REFINEMENTS = 24, 2
"""Places of a bound about an edge, and how often the best is surrounded by finer ones (a choice: to 1 % of a step)."""
EVERYWHERE = ((0,), (0, 1), (0, 1, 2), (0, 1, 2, 3))
"""Powers of the simplest smooth laws that hold everywhere."""


@dataclass(frozen=True)
class Found:
    """A region on some wheels, its gain in score beside the fit, and the penalty of its choice from many."""

    score: float
    region: Region
    wheels: tuple[int, ...]
    selection_penalty: float


def regions_beside(equations: NormalEquations, named: Fit, needed: float) -> tuple[NormalEquations, Fit]:
    """Return the fit with regions, as long as a further one is significant; and equations with their columns.

    Steps are tried first, then simple forms: a polynomial over much of the range imitates two regions. In the better
    of the two, each region may then take any form beside the others.
    """
    best = named
    for forms in FIRST_FORMS:
        equations, fit = _one_after_another(equations, named, forms, needed)
        best = max(best, fit, key=equations.score)
    first = len(named.terms)
    for index in range(first, len(best.terms)):
        equations, best = _searched_again(equations, best, index)
    return equations, _significant(equations, best, first)


def _one_after_another(
    equations: NormalEquations, named: Fit, forms: Forms, needed: float
) -> tuple[NormalEquations, Fit]:
    """Return the fit with the best region, then with the best beside that one, and so on.

    The search ends early where the score `needed` is out of reach, a further region gaining no more than the last.
    """
    fit = named
    for further in reversed(range(MOST_REGIONS)):
        found = best_region(equations, fit, forms)
        if found is None:
            break
        equations, term = with_region(equations, found)
        more = equations.fit((*fit.terms, term))
        if equations.score(more) + further * (equations.score(more) - equations.score(fit)) < needed:
            break
        fit = more
    return equations, fit


def best_region(equations: NormalEquations, fit: Fit, forms: Forms) -> Found | None:
    """Return the region with the best score beside a fit, over the covariates of significant smooth terms."""
    curves = significant_curves(equations, fit)[:CURVES_TRIED]
    if not curves:
        return None
    read = as_read(equations, fit)
    found = [region for curve in curves if (region := _region_of(equations, fit, read, curve, forms)) is not None]
    best = max(found, key=lambda each: each.score, default=None)
    return best if best is not None and best.score > 0 else None


def significant_curves(equations: NormalEquations, fit: Fit) -> list[Term]:
    """Return the best smooth term beside a fit for each covariate and coupling, best first; a constant is none."""
    none = {"", *WITHOUT_CURVE}
    groups = [group for group in equations.design.groups if not group.named and group.coupling not in none]
    further = equations.further(fit.terms, groups)
    scored = [(gain - equations.penalty(term), term) for gain, term in further if not is_constant(term)]
    best: dict[tuple[str, str], Term] = {}
    for score, term in sorted(scored, key=lambda pair: -pair[0]):
        if score > equations.thresholds.smooth_term_entry:
            best.setdefault((term.name, term.group.coupling), term)
    return list(best.values())


def _searched_again(equations: NormalEquations, fit: Fit, index: int) -> tuple[NormalEquations, Fit]:
    """Return the fit with the best region in the place of one of it, beside the others."""
    rest = equations.fit(fit.without(index))
    found = best_region(equations, rest, FORMS)
    if found is None:
        return equations, fit
    equations, term = with_region(equations, found)
    return equations, max(fit, equations.fit((*fit.terms[:index], term, *fit.terms[index + 1 :])), key=equations.score)


def _significant(equations: NormalEquations, fit: Fit, first: int) -> Fit:
    """Return the fit without regions, its terms from `first` on, that score nothing beside the others."""
    for index in reversed(range(first, len(fit.terms))):
        rest = equations.fit(fit.without(index))
        if equations.score(fit) - equations.score(rest) <= 0:
            fit = rest
    return fit


def everywhere_score(
    equations: NormalEquations, named: Fit, covariate: str, coupling: str, wheels: Sequence[int]
) -> float:
    """Return what the best of the simplest smooth laws over a covariate adds to the named effects' score.

    Its coefficients are paid for by Schwarz's criterion, as those of regions.
    """
    values = known_values(equations, covariate, coupling, wheels)
    low, high = float(values.min()), float(values.max())
    of_each = schwarz_penalty(equations, named, wheels)
    scores = []
    for powers in EVERYWHERE:
        everywhere = Region(covariate, coupling, -np.inf, np.inf, powers, 0.5 * (low + high), max(high - low, 1e-300))
        equations, law = with_region(equations, Found(0.0, everywhere, tuple(wheels), 0.0))
        gain = equations.fit((*named.terms, law)).delta_chi2 - named.delta_chi2
        scores.append(gain - of_each * len(powers))
    return max(scores)


def with_region(equations: NormalEquations, found: Found) -> tuple[NormalEquations, Term]:
    """Return equations with a region's columns, and its term."""
    region = found.region
    values, factor = acting(equations.problem, region.covariate, region.coupling)
    design, places = equations.design.extended(region.columns(values, factor))
    group = Group(
        name=region.covariate,
        columns=places,
        signs=(0,) * len(places),
        sharing=("all", "one"),
        selection_penalty=found.selection_penalty,
        coupling=region.coupling,
        region=region,
    )
    return equations.over(design), Term(group, found.wheels)


def _region_of(equations: NormalEquations, fit: Fit, read: AsRead, curve: Term, forms: Forms) -> Found | None:
    """Return the best region over the covariate of a smooth term beside a fit, apart from its regions."""
    covariate, coupling, wheels = curve.name, curve.group.coupling, curve.wheels
    edges = edges_of(known_values(equations, covariate, coupling, wheels))
    if not len(edges):
        return None
    sums = range_sums(equations, read, covariate, coupling, wheels, edges)
    ranges = allowed(sums, Ranges(*np.triu_indices(len(edges) + 2, 1)), fit)
    of_each = schwarz_penalty(equations, fit, wheels)
    coarse = sorted(_best_of_each_form(equations, sums, ranges, forms, of_each), key=_rank)
    refined = (_refined(equations, read, wheels, choice, edges) for choice in coarse[:REFINED])
    best = min(refined, key=_rank, default=None)
    if best is None:
        return None
    # What a smooth term on these wheels pays beyond its coefficients, a region on them pays too.
    of_wheels = equations.penalty(curve) - equations.thresholds.coefficient_penalty * len(curve.group.columns)
    return Found(best.score - of_wheels, best.region, wheels, best.penalty)


@dataclass(frozen=True)
class _Choice:
    """A range with the form in it, its score, and the penalty of its having been chosen from many of its kind."""

    score: float
    region: Region
    penalty: float


def _rank(choice: _Choice) -> float:
    return -choice.score


def _best_of_each_form(
    equations: NormalEquations, sums: RangeSums, ranges: Ranges, forms: Forms, of_each: float
) -> list[_Choice]:
    """Return the best range with one bound, and with two, for each form.

    Each pays for its coefficients and bounds by Schwarz's criterion (`of_each`), for the choice of its form, and for
    holding more readings than it leaves: what acts in a range may be said of the rest as well, where a parameter of
    the simulation makes up for it.
    """
    found, odds = [], odds_of(sums, ranges)
    open_ended = (ranges.first == 0) | (ranges.last == len(sums.edges) + 1)
    for powers, gains in zip(forms, sums.delta_chi2(ranges, forms), strict=True):
        for kind, bounds in ((open_ended, 1), (~open_ended, 2)) if powers != GROWTH else ((open_ended, 1),):
            if kind.any():
                scores = np.where(kind, gains - odds, -np.inf)
                at = int(np.argmax(scores))
                whole = (bounds + len(powers)) * of_each + 2 * float(np.log(len(FORMS))) + float(odds[at])
                penalty = whole - equations.thresholds.coefficient_penalty * len(powers)
                score = float(gains[at]) - whole
                region = sums.region(int(ranges.first[at]), int(ranges.last[at]), powers)
                found.append(_Choice(score, region, penalty))
    return found


def schwarz_penalty(equations: NormalEquations, fit: Fit, wheels: Sequence[int]) -> float:
    """Return ln n, with n the number of independent readings on some wheels: Σ weight × what the fit leaves²."""
    on = list(wheels)
    readings = float(chi2_of(equations, fit)[on].sum())
    return float(np.log(max(readings, math.e)))


def schwarz_surcharge(equations: NormalEquations, fit: Fit, curves: Sequence[Term]) -> float:
    """Return what curves pay for their coefficients by Schwarz's criterion, as regions do, beyond their penalties."""
    paid = equations.thresholds.coefficient_penalty
    return sum((schwarz_penalty(equations, fit, each.wheels) - paid) * len(each.group.columns) for each in curves)


def odds_of(sums: RangeSums, ranges: Ranges) -> Array:
    """Return what ranges pay for holding more readings than they leave, in Δχ², shape (range,)."""
    share = sums.share(ranges)
    return np.asarray(2 * np.log(np.maximum(share / (1 - share), 1.0)))


def _refined(
    equations: NormalEquations, read: AsRead, wheels: tuple[int, ...], choice: _Choice, edges: Array
) -> _Choice:
    """Return a choice with its bounds at their best between the edges of the search."""
    region = choice.region
    spacing = _spacing(edges, region)
    for _ in range(REFINEMENTS):
        places = [
            np.linspace(bound - step, bound + step, REFINED_PLACES) if np.isfinite(bound) else np.zeros(0)
            for bound, step in zip((region.lower, region.upper), spacing, strict=True)
        ]
        fine = np.unique(np.concatenate(places))
        sums = range_sums(equations, read, region.covariate, region.coupling, wheels, fine)
        ranges = allowed(sums, between(fine, *places), read.fit)
        if not len(ranges.first):
            return choice
        gains = sums.delta_chi2(ranges, [region.powers])[0]
        at = int(np.argmax(gains))
        score = float(gains[at]) - choice.penalty - equations.thresholds.coefficient_penalty * len(region.powers)
        if score > choice.score:
            region = sums.region(int(ranges.first[at]), int(ranges.last[at]), region.powers)
            choice = _Choice(score, region, choice.penalty)
        spacing = [2 * step / REFINED_PLACES for step in spacing]
    return choice


def _spacing(edges: Array, region: Region) -> list[float]:
    """Return how far apart the edges are about each bound."""
    found = []
    for bound in (region.lower, region.upper):
        at = int(np.clip(np.searchsorted(edges, bound), 1, len(edges) - 2)) if np.isfinite(bound) else 1
        found.append(float(max(edges[at + 1] - edges[at], edges[at] - edges[at - 1])))
    return found


def between(edges: Array, lower: Array, upper: Array) -> Ranges:
    """Return all ranges from a lower to an upper bound, which are among the edges; empty stands for no bound."""
    first = 1 + np.searchsorted(edges, lower) if len(lower) else np.array([0])
    last = 1 + np.searchsorted(edges, upper) if len(upper) else np.array([len(edges) + 1])
    pairs = np.meshgrid(first, last, indexing="ij")
    return Ranges(pairs[0].ravel(), pairs[1].ravel())


def allowed(sums: RangeSums, ranges: Ranges, fit: Fit) -> Ranges:
    """Return the ranges with readings in and outside of them, and apart from the regions of a fit."""
    forwards = ranges.first < ranges.last
    share = sums.share(ranges)
    kept = forwards & (share > FEWEST_SHARE) & (share < 1 - FEWEST_SHARE) & _apart(sums, ranges, fit)
    return Ranges(ranges.first[kept], ranges.last[kept])


def edges_of(values: Array) -> Array:
    """Return where a region may begin or end: quantiles and even steps of a covariate; none of a constant one."""
    within = np.linspace(0, 1, EDGES + 2)[1:-1]
    low, high = (float(q) for q in np.quantile(values, (0.002, 0.998)))
    return (
        np.unique(np.concatenate((np.quantile(values, within), low + (high - low) * within)))
        if high > low
        else np.zeros(0)
    )


def _apart(sums: RangeSums, ranges: Ranges, fit: Fit) -> Mask:
    """Return which ranges overlap no region of the fit over the same covariate, however that acts."""
    lower = np.concatenate(([-np.inf], sums.edges, [np.inf]))[ranges.first]
    upper = np.concatenate(([-np.inf], sums.edges, [np.inf]))[ranges.last]
    apart = np.ones(len(lower), np.bool_)
    for term in fit.terms:
        region = term.group.region
        if region is not None and _axis(region.covariate, region.coupling) == _axis(sums.covariate, sums.coupling):
            apart &= (lower >= region.upper) | (upper <= region.lower)
    return apart


def _axis(covariate: str, coupling: str) -> tuple[str, bool]:
    """Return what bounds are places on: a covariate, a speed with its sign where what acts depends on it."""
    return covariate, coupling == "each way"
