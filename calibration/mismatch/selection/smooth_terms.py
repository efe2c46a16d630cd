"""Smooth terms against named effects: what stays unexplained.

A smooth term wins in two ways: beside the named effects, where it explains much that they leave; and against them,
where one covariate's curve scores more than several effects of other covariates, which then only imitate it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.regression.groups.smooth_groups import curves_over_time, same_covariate
from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of
from regolithd.calibration.mismatch.selection.best_subsets import (
    acceptable,
    best_of_each_smooth_term,
    chi2_quantile,
    wheels_of_faulty_sensors,
)
from regolithd.calibration.mismatch.selection.plausibility.changed_parameters import (
    drop_what_a_changed_parameter_explains,
)
from regolithd.calibration.mismatch.selection.plausibility.law_misfit import (
    is_of_the_prediction,
    law_misfit,
    misfit_beside,
)
from regolithd.calibration.mismatch.selection.slow_noise import (
    best_curve,
    lead_beside_slow_noise,
    score_beside_slow_noise,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


def weigh_against_smooth_terms(
    equations: NormalEquations, named: Fit, simpler: Sequence[Fit], entry_threshold: float
) -> tuple[Fit, tuple[Term, ...]]:
    """Return the effects that keep their names, and the smooth terms that they leave.

    Some of the effects alone (`simpler`, smallest first) that leave nothing significant are preferred to a smooth term.
    """
    alone = best_of_each_smooth_term(equations, ())
    passed = named
    named = drop_what_a_changed_parameter_explains(equations, drop_transients(equations, named))
    refuted = [term for term in passed.terms if term not in named.terms]
    curve = best_curve(equations, (), alone)
    behind = curve is not None and _is_behind_a_curve(equations, named, curve)
    names = {term.name for term in named.terms}
    for fit in simpler if behind else ():
        if names.issuperset(term.name for term in fit.terms) and unexplained_beside(equations, fit) is None:
            return fit, ()
    left = unexplained_beside(equations, named) or _rest_of_refuted(equations, named, refuted, entry_threshold)
    if curve is not None:
        misfit = law_misfit(equations, named, equations.fit((curve,))) if behind else 0.0
        beside = _effects_beside_curve(equations, named, curve, entry_threshold)
        with_rest = named if left is None else equations.fit((*named.terms, left))
        # Laws that are a little wrong are behind a curve as well, where the noise is small.
        imitated = misfit > equations.thresholds.form_misfit
        if imitated or _explains_more(equations, beside, with_rest, entry_threshold):
            kept = equations.fit([term for term in beside.terms if term.group.named])
            return drop_what_a_curve_explains(equations, kept, curve), (curve,)
    return (named, ()) if left is None else (drop_what_a_curve_explains(equations, named, left), (left,))


def _rest_of_refuted(
    equations: NormalEquations, named: Fit, refuted: Sequence[Term], entry_threshold: float
) -> Term | None:
    """Return the curve over time that is left where a name passed every test but that of how it changes.

    What was significant enough for the name is there, whatever its name: the entry of names suffices.
    """
    wheels = {term.wheels for term in refuted}
    curves = best_of_each_smooth_term(equations, named.terms) if refuted else []
    found = [(score, term) for score, term in curves if term.name == "time" and term.wheels in wheels]
    return found[0][1] if found and found[0][0] > entry_threshold else None


def _is_behind_a_curve(equations: NormalEquations, named: Fit, curve: Term) -> bool:
    """Return whether one curve scores more than several effects, of which some have other covariates.

    The curve has not to be likelier by chance, as it would be by a name's entry, but significant beyond the effects.
    """
    if len(named.terms) < 2 or all(term.imitated_over == curve.name for term in named.terms):
        return False
    return _is_ahead(equations, equations.fit((curve,)), named, equations.thresholds.smooth_term_entry)


def _explains_more(equations: NormalEquations, curve: Fit, named: Fit, entry_threshold: float) -> bool:
    """Return whether a curve, and what stands beside it, has more evidence than names and what they leave.

    Each term has to pay for its own entry. Names that leave nothing have paid for theirs: there the curve must be of
    another covariate, and gain beyond them what is significant and more than a law's misfit.
    """
    limits = equations.thresholds
    if all(term.group.named for term in named.terms):
        of_its_covariate = all(term.imitated_over == curve.terms[-1].name for term in named.terms)
        misfit = law_misfit(equations, named, curve)
        another_law = not of_its_covariate and misfit > limits.form_misfit
        return another_law and _is_ahead(equations, curve, named, limits.smooth_term_entry)
    further = sum(term.group.named for term in named.terms) - sum(term.group.named for term in curve.terms)
    return _is_ahead(equations, curve, named, -entry_threshold * max(further, 0))


def _is_ahead(equations: NormalEquations, curve: Fit, named: Fit, by: float) -> bool:
    """Return whether a fit with a curve scores more by so much, by the weights and in noise of any spectrum."""
    if equations.score(curve) - equations.score(named) <= by:
        return False
    return lead_beside_slow_noise(equations, curve.terms, named.terms) > by


def _effects_beside_curve(equations: NormalEquations, named: Fit, curve: Term, entry_threshold: float) -> Fit:
    """Return the fit of a curve with those effects that still pass the entry threshold beside it."""
    kept: tuple[Term, ...] = ()
    fit = equations.fit((curve,))
    for term in named.terms:
        trial = equations.fit((*kept, term, curve))
        if equations.score(trial) - equations.score(fit) > entry_threshold and acceptable(equations, trial):
            kept, fit = (*kept, term), trial
    return fit


def unexplained_beside(equations: NormalEquations, named: Fit, *, tolerated: float | None = None) -> Term | None:
    """Return the best smooth term beside the effects, if it is significant, large, and more than a law's misfit.

    `tolerated` is the share that is a law's misfit, by default `form_misfit`; none where parameters leave their priors
    beside the effects: then it is not the law that is a little wrong. Where the best one is of the prediction, which
    follows what any law leaves, the best of another covariate is asked as well.
    """
    limits, faulty = equations.thresholds, wheels_of_faulty_sensors(named)
    if tolerated is None:
        leaving = equations.nuisance.leaving_their_priors(named, equations.problem)
        tolerated = 0.0 if leaving.size else limits.form_misfit
    curves = best_of_each_smooth_term(equations, named.terms)
    left = [(score, term) for score, term in curves if not set(term.wheels) <= faulty]
    others = [(score, term) for score, term in left if not is_of_the_prediction(equations.problem, term)]
    for sought in (left, others):
        curve = best_curve(equations, named.terms, sought)
        if curve is None or _is_a_finding(equations, named, curve, tolerated):
            return curve
        if not is_of_the_prediction(equations.problem, curve):
            return None
    return None


def _is_a_finding(equations: NormalEquations, named: Fit, curve: Term, tolerated: float) -> bool:
    """Return whether a curve holds much of what effects leave, and more than this share as their laws' misfit."""
    beside = equations.fit((*named.terms, curve))
    if power_share(equations, beside, named) < equations.thresholds.smooth_term_power:
        return False
    return not named.terms or misfit_beside(equations, named, beside) >= tolerated


def power_share(equations: NormalEquations, beside: Fit, named: Fit) -> float:
    """Return the share of what is left on its wheels that the last term of a fit holds, of what it leaves without."""
    on = list(beside.terms[-1].wheels)
    power = np.sum(contribution(equations, beside, len(beside.terms) - 1)[:, on] ** 2)
    return float(power / max(float(np.sum(residual_of(equations, named)[:, on] ** 2)), 1e-300))


def drop_what_a_curve_explains(equations: NormalEquations, named: Fit, curve: Term) -> Fit:
    """Leave out effects that a curve may hold: what has no law leaks into every law.

    These are effects of the curve's own covariate, which are a part of one unknown law, and those that gain little
    beside a curve that gains much.
    """
    kept = drop_what_gains_little(equations, named, curve).terms
    return equations.fit([term for term in kept if not _same_quantity(equations.problem, term, curve)])


def drop_what_gains_little(equations: NormalEquations, named: Fit, curve: Term) -> Fit:
    """Leave out effects that gain little beside a curve that gains much, on their part of its wheels."""
    both = equations.fit((*named.terms, curve))
    least = equations.thresholds.beside_smooth_share * (both.delta_chi2 - named.delta_chi2)
    kept = []
    for index, term in enumerate(named.terms):
        gain = both.delta_chi2 - equations.fit((*named.without(index), curve)).delta_chi2
        if gain >= least * len(set(term.wheels) & set(curve.wheels)) / len(curve.wheels):
            kept.append(term)
    return equations.fit(kept)


def _same_quantity(problem: Problem, term: Term, curve: Term) -> bool:
    """Return whether a term's covariate is a curve's on the same wheels."""
    wheels = sorted(set(term.wheels) & set(curve.wheels))
    if not wheels or term.imitated_over == "none":
        return False
    covariate = term.group.candidate.covariate if term.group.candidate else term.name
    return same_covariate(problem, covariate, curve.name, wheels)


def drop_transients(equations: NormalEquations, named: Fit) -> Fit:
    """Leave out changes that come and go: what wears, or drives onto other soil, does not heal.

    They show in a curve over time on the same wheels that is significant beside them, and beside what a curve over
    another covariate explains better. One covariate on given wheels was not selected from many, so a plain test of its
    Δχ² suffices.
    """
    if not any(map(_is_lasting_change, named.terms)):
        return named
    left = best_curve(equations, named.terms, best_of_each_smooth_term(equations, named.terms))
    given = named if left is None or left.name == "time" else equations.fit((*named.terms, left))
    beside, kept = equations.further(given.terms, curves_over_time(equations.design)), []
    for term in named.terms:
        shares = [
            gain / (gain + named.delta_chi2)
            for gain, curve in beside
            if curve.wheels == term.wheels and _is_significant(equations, given, curve, gain)
        ]
        if not _is_lasting_change(term) or max(shares, default=0.0) < equations.thresholds.form_misfit:
            kept.append(term)
    return named if len(kept) == len(named.terms) else equations.fit(kept)


def _is_lasting_change(term: Term) -> bool:
    """Return whether a term begins some time and lasts; a sensor's fault, which its own channel shows, may go."""
    return term.imitated_over == "time" and term.group.own_channel is None


def _is_significant(equations: NormalEquations, given: Fit, curve: Term, gain: float) -> bool:
    """Return whether one curve gains more beside others than chance, by the weights and in noise of any spectrum."""
    by_chance = chi2_quantile(equations, len(curve.group.columns))
    if gain <= by_chance:
        return False
    return score_beside_slow_noise(equations, given.terms, [curve]) + equations.penalty(curve) > by_chance
