"""A law that holds in a range alone: no name that holds everywhere may stand for it.

Friction below a temperature, or a drag beyond an angle, leaks into laws that hold everywhere and are then named, with a
curve for the rest. Where a candidate's law confined to a range of a covariate is more probable than such a name with
all that stands beside it, the name goes; what is left is told as unexplained over that covariate, with the range.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.group import Group, Term
from regolithd.calibration.mismatch.regression.groups.lagged_groups import WITHOUT_CURVE
from regolithd.calibration.mismatch.regression.groups.smooth_groups import acting, couplings_of
from regolithd.calibration.mismatch.regression.likelihood.as_read import as_read
from regolithd.calibration.mismatch.regression.products.range_sums import Ranges, known_values, sums_over_ranges
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_candidate, best_of_each_smooth_term
from regolithd.calibration.mismatch.selection.by_region.region_search import (
    Found,
    allowed,
    edges_of,
    odds_of,
    schwarz_penalty,
    schwarz_surcharge,
    with_region,
)
from regolithd.calibration.mismatch.selection.decision import ConfinedLaw
from regolithd.calibration.mismatch.selection.plausibility.law_misfit import law_misfit
from regolithd.calibration.mismatch.selection.slow_noise import lead_beside_slow_noise
from regolithd.calibration.mismatch.selection.smooth_terms import unexplained_beside

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.groups.region import Region
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]

LAWS_TRIED = 6
"""Laws that are confined to ranges, beside the one that was named (a choice: computing time)."""
COVARIATES_TRIED = 3
"""Covariates over whose ranges they are (a choice: computing time)."""
STEP = (0,)
"""A law's own size, the same in the whole range."""


@dataclass(frozen=True, eq=False)
class Confined:
    """A law in a range: the equations with its column, the fit with it beside the rest, and the score of that."""

    equations: NormalEquations
    fit: Fit
    law: Term
    region: Region
    score: float


def without_confined_laws(decision: Decision) -> Decision:
    """Return the decision without names in whose place a law in a range is more probable, regions in their place.

    A curve that stood beside the name stays where it is significant beside the region. What comes and goes is in no
    region. Where a curve over the whole of the covariate is more probable than the law in a range, that takes the place
    of the name.
    """
    if decision.intermittent:
        return decision
    while (found := _better_in_a_range(decision)) is not None:
        index, confined = found
        rest = decision.equations.fit(decision.named.without(index))
        told = tuple(each.region for each in decision.confined)
        if (curve := _better_everywhere(decision.equations, rest, confined)) is not None:
            equations, place, laws = decision.equations, curve, decision.confined
        else:
            equations, whole = _with_region(decision.equations, rest, confined)
            place = whole.terms[-1]
            laws = (*decision.confined, ConfinedLaw(confined.law, place))
        left = unexplained_beside(equations, equations.fit((*rest.terms, *told, place)))
        unnamed = (*told, place) if left is None or left.name == place.name else (*told, place, left)
        decision = replace(
            decision,
            equations=equations,
            named=equations.fit(rest.terms),
            unnamed=unnamed,
            whole=equations.fit((*rest.terms, *unnamed)),
            confined=laws,
        )
    return decision


def _better_in_a_range(decision: Decision) -> tuple[int, Confined] | None:
    """Return the name that a law in a range is better than, by its index, and that law; None: there is none."""
    equations, named, limits = decision.equations, decision.named, decision.equations.thresholds
    told = _told_score(decision)
    best: tuple[int, Confined] | None = None
    for index, term in enumerate(named.terms):
        if not _may_be_confined(term):
            continue
        rest = equations.fit(named.without(index))
        for confined in _in_ranges(equations, rest, term, _covariates(decision, term)):
            ahead = confined.score - told
            instead = law_misfit(equations, named, confined.fit)
            of_its_covariate = confined.region.covariate == term.imitated_over
            better = ahead > limits.smooth_term_entry and (not of_its_covariate or instead > limits.form_misfit)
            better = better and (best is None or confined.score > best[1].score)
            if better and _lead_in_slow_noise(decision, confined) > limits.slow_noise_entry:
                best = index, confined
    return best


def _better_everywhere(equations: NormalEquations, rest: Fit, confined: Confined) -> Term | None:
    """Return the curve over the covariate of a law in a range that scores more than that, if there is one."""
    place = confined.region.covariate, confined.law.wheels
    best, most = None, confined.score
    for _, curve in best_of_each_smooth_term(equations, rest.terms):
        if (curve.name, curve.wheels) != place or curve.group.coupling in WITHOUT_CURVE:
            continue
        score = equations.score(equations.fit((*rest.terms, curve))) - schwarz_surcharge(equations, rest, [curve])
        best, most = (curve, score) if score > most else (best, most)
    return best


def _told_score(decision: Decision) -> float:
    """Return the score of what was decided, its curves paid for by Schwarz's criterion as ranges are."""
    return decision.equations.score(decision.whole) - _surcharge(decision)


def _surcharge(decision: Decision) -> float:
    """Return what the curves of what was decided pay beyond their penalties, by Schwarz's criterion."""
    curves = [term for term in decision.unnamed if term.group.region is None]
    return schwarz_surcharge(decision.equations, decision.whole, curves)


def _lead_in_slow_noise(decision: Decision, confined: Confined) -> float:
    """Return how far a law in a range is ahead of what was decided, in noise of any spectrum."""
    lead = lead_beside_slow_noise(confined.equations, confined.fit.terms, decision.whole.terms)
    return lead + _surcharge(decision)


def _may_be_confined(term: Term) -> bool:
    """Return whether a term is a law of the machine: no sensor's fault, no change at a time, no corrected effect."""
    group = term.group
    return not group.is_change and group.own_channel is None and term.imitated_over not in {"time", "none"}


def _covariates(decision: Decision, term: Term) -> list[tuple[str, str]]:
    """Return covariates over whose ranges a term's law may be confined, each with a coupling of smooth terms there.

    These are the covariates of what is left on its wheels, whether told or tolerated, and the law's own.
    """
    equations, least = decision.equations, decision.equations.thresholds.smooth_term_entry
    scored = best_of_each_smooth_term(equations, decision.named.terms)
    left = (*decision.unnamed, *(curve for score, curve in scored if score > least))
    own = (curve for _, curve in scored if curve.name == term.imitated_over)
    found: dict[str, str] = {}
    for curve in (*left, *own):
        if curve.group.coupling not in WITHOUT_CURVE and set(curve.wheels) & set(term.wheels):
            found.setdefault(curve.name, curve.group.coupling)
    kept = list(found.items())
    return [*kept[:COVARIATES_TRIED], *(each for each in kept[COVARIATES_TRIED:] if each[0] == term.imitated_over)]


def _in_ranges(
    equations: NormalEquations, rest: Fit, named: Term, covariates: Sequence[tuple[str, str]]
) -> Iterator[Confined]:
    """Yield the best range of each covariate for each law in the place of a named one.

    A law that is taken to hold everywhere has another shape than in the range in which it holds: each of them is tried.
    """
    if not covariates:
        return
    others = [
        term
        for _, term in best_of_each_candidate(equations, rest.terms)
        if term.wheels == named.wheels and term.name != named.name and _may_be_confined(term)
    ]
    groups = (group for group in equations.design.groups if group.named and group.name == named.name)
    laws = [*(Term(group, named.wheels) for group in groups), *others[:LAWS_TRIED]]
    laws = [law for law in laws if len(law.group.columns) == 1]
    design, read = equations.design, as_read(equations, rest)
    columns = [design.in_time(design.columns_as_read(law.group.columns)[0].astype(np.float64)) for law in laws]
    for covariate, coupling in covariates:
        values, _ = acting(equations.problem, covariate, coupling)
        edges = edges_of(known_values(equations, covariate, coupling, named.wheels))
        for law, column in zip(laws, columns, strict=True):
            if not len(edges) or covariate == law.imitated_over:
                continue
            sums = sums_over_ranges(equations, read, (covariate, coupling), (values, column), law.wheels, edges)
            ranges = allowed(sums, Ranges(*np.triu_indices(len(edges) + 2, 1)), rest)
            if len(ranges.first):
                at = int(np.argmax(sums.delta_chi2(ranges, [STEP])[0] - odds_of(sums, ranges)))
                region = sums.region(int(ranges.first[at]), int(ranges.last[at]), STEP)
                yield _confined(equations, rest, law, region, (values, column))


def _confined(
    equations: NormalEquations, rest: Fit, law: Term, region: Region, course: tuple[Array, Array]
) -> Confined:
    """Return a law in a range, fitted beside the rest; it pays for its bounds as a region does, and as a law does."""
    design, places = equations.design.extended(region.columns(*course))
    bounds = int(np.isfinite(region.lower)) + int(np.isfinite(region.upper))
    of_each = schwarz_penalty(equations, rest, law.wheels)
    penalty = (1 + bounds) * of_each + 2 * float(np.log(LAWS_TRIED * COVARIATES_TRIED))
    group = Group(
        name=region.covariate,
        columns=places,
        signs=law.group.signs,
        sharing=law.group.sharing,
        selection_penalty=penalty - equations.thresholds.coefficient_penalty,
        coupling=region.coupling,
        region=region,
    )
    grown = equations.over(design)
    fit = grown.fit((*rest.terms, Term(group, law.wheels)))
    value = float(fit.coefficients[fit.of_term(len(rest.terms))][0])
    right_sign = value * law.group.signs[0] >= 0
    return Confined(grown, fit, law, region, grown.score(fit) if right_sign else -np.inf)


def _with_region(equations: NormalEquations, rest: Fit, confined: Confined) -> tuple[NormalEquations, Fit]:
    """Return the fit with the range as a region of the coupling that explains most there, and equations with it."""
    best: tuple[NormalEquations, Fit] | None = None
    for coupling in couplings_of(equations.problem):
        region = replace(confined.region, coupling=coupling)
        penalty = confined.fit.terms[-1].group.selection_penalty
        equations, term = with_region(equations, Found(0.0, region, confined.law.wheels, penalty))
        fit = equations.fit((*rest.terms, term))
        if best is None or fit.delta_chi2 > best[1].delta_chi2:
            best = equations, fit
    assert best is not None  # noqa: S101  # there are always offset and gain
    return equations, best[1]
