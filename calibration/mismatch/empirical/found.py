"""The empirical curve and the suggestions of a decision's smooth term, as the answer and the report have them."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import Parameter, Suggestion
from regolithd.calibration.mismatch.empirical.spline import CLOSE_KNOTS, KNOTS, fit_spline, knots_of
from regolithd.calibration.mismatch.empirical.suggestions import (
    SUGGESTED,
    FittedForm,
    best_forms,
    held_out_squares,
    standard_deviations,
)
from regolithd.calibration.mismatch.empirical.sums import points_beside, profile, squares_on_fold, sums_of
from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve
from regolithd.calibration.mismatch.problem.words import divided, product, unit_in_label, word_for
from regolithd.calibration.mismatch.regression.groups.lagged_groups import WITHOUT_CURVE
from regolithd.calibration.mismatch.regression.groups.smooth_groups import EACH_WAY, PERIODIC, SINES, follows_size
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.empirical.spline import Spline
    from regolithd.calibration.mismatch.empirical.sums import CovariateSums, Points
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]

ALONG = "drag, "
"""The beginning of the couplings that act oppositely on two parts."""
X = re.compile(r"(?<![a-z])x(?![a-z])")
"""The covariate in the text of a form."""
TIMES = re.compile(r"\b([cd]) (?=[a-z√|(])(?!where)")
"""A coefficient and what it is multiplied by."""
POWERS = {0.0: "", 1.0: "", 2.0: "²", 3.0: "³", -1.0: "", -2.0: "²"}
"""Exponents of a unit, without their sign; others stand as numbers."""


@dataclass(frozen=True, eq=False)
class FoundCurve:
    """What a smooth term becomes.

    Attributes
    ----------
    terms: the smooth terms, several where it acts in several ranges of one covariate
    curve: with its band and held-out errors
    suggestions: closed forms, best first
    fit: of the free parameters and the named effects beside the curve
    points: what these leave, in bins of the covariate
    suggested: the first suggestion at the curve's knots; empty where there is none
    """

    terms: tuple[Term, ...]
    curve: EmpiricalCurve
    suggestions: tuple[Suggestion, ...]
    fit: Fit
    points: Points
    suggested: Array


def curves_of(decision: Decision) -> tuple[FoundCurve, ...]:
    """Return the curves of what stays unexplained; a sine over time, and what was before, have none."""
    places: dict[tuple[str, str, tuple[int, ...]], list[Term]] = {}
    for term in decision.unnamed:
        if (coupling := _coupling_of_curve(decision.equations.problem, term)) is not None:
            places.setdefault((term.name, coupling, term.wheels), []).append(term)
    return tuple(_found(decision, tuple(terms), coupling) for (_, coupling, _), terms in places.items())


def _coupling_of_curve(problem: Problem, term: Term) -> str | None:
    """Return how a term acts; of a sine over a covariate how its curve does. None: it is no curve."""
    coupling = term.group.coupling
    if term.name != "time" and coupling in SINES:
        return "drag" if coupling == PERIODIC and "direction" in problem.covariates else "offset"
    return None if coupling in WITHOUT_CURVE else coupling


def _found(decision: Decision, terms: tuple[Term, ...], coupling: str) -> FoundCurve:
    term = replace(terms[0], group=replace(terms[0].group, coupling=coupling))
    sums = sums_of(decision.equations, decision.named, term, decision.whole)
    whole = profile(sums)
    closely = term.name == "time" or any(each.group.coupling in WITHOUT_CURVE for each in terms)
    knots = knots_of(sums, CLOSE_KNOTS if closely else KNOTS)
    spline = fit_spline(whole, sums.at, knots)
    curve = _curve(decision.equations.problem, term, spline, _held_out(sums, knots))
    others = whole.others(spline.in_bins)
    told = _suggestions(decision, curve, term, sums)
    return FoundCurve(
        terms=terms,
        curve=curve,
        suggestions=tuple(suggestion for _, suggestion in told),
        fit=replace(decision.named, coefficients=others),
        points=points_beside(sums, others),
        suggested=told[0][0].values(spline.at) if told else np.zeros(0),
    )


def _held_out(sums: CovariateSums, knots: Array) -> tuple[float, float]:
    """Return the root-mean-square errors on held-out folds, without and with a curve that the others fitted."""
    before, after = np.zeros(len(sums.weights)), np.zeros(len(sums.weights))
    nothing = np.zeros(len(sums.at))
    for fold in sums.folds:
        train = profile(sums, sums.other_folds(fold))
        values = fit_spline(train, sums.at, knots).in_bins
        before += squares_on_fold(sums, fold, nothing, train.others(nothing))
        after += squares_on_fold(sums, fold, values, train.others(values))
    return _rms(sums, before), _rms(sums, after)


def _rms(sums: CovariateSums, squares: Array) -> float:
    return float(np.sqrt(max(float(squares.sum()), 0.0) / sums.counts.sum()))


def _curve(problem: Problem, term: Term, spline: Spline, held_out: tuple[float, float]) -> EmpiricalCurve:
    units = problem.simulation.unit, unit_in_label(term.name, problem.labels)
    return with_band(term.name, term.group.coupling, units, (spline.at, spline.value, spline.std), held_out)


def with_band(
    covariate: str,
    coupling: str,
    units: tuple[str, str],
    knots: tuple[Array, Array, Array],
    held_out: tuple[float, float],
) -> EmpiricalCurve:
    """Return a curve with its 90 % band.

    Parameters
    ----------
    units: of the channel, and of the covariate
    knots: where they are, values there and their standard deviations, shape (knot,) each
    held_out: errors without and with the curve
    """
    at, value, std = knots
    reach = NINETY_PERCENT_STDS * std
    return EmpiricalCurve(
        coupling=coupling,
        magnitude=follows_size(covariate, coupling),
        unit="1" if coupling == "gain" else units[0],
        covariate_unit=units[1],
        at=tuple(at.tolist()),
        value=tuple(value.tolist()),
        low=tuple((value - reach).tolist()),
        high=tuple((value + reach).tolist()),
        held_out_rmse_before=held_out[0],
        held_out_rmse_after=held_out[1],
    )


def _suggestions(
    decision: Decision, curve: EmpiricalCurve, term: Term, sums: CovariateSums
) -> list[tuple[FittedForm, Suggestion]]:
    """Return the closed forms that lower the held-out error, the best first; none over time.

    What happened at some time has no law over time.
    """
    forms = best_forms(sums, decision.noise.autocorrelation_time)[:SUGGESTED] if term.name != "time" else []
    found = [(bic, form, _rms(sums, held_out_squares(sums, form))) for bic, form in forms]
    found = [each for each in found if each[2] < curve.held_out_rmse_before]
    problem = decision.equations.problem
    return [
        (form, _suggestion(problem, curve, term, sums, form, error, bic - found[0][0])) for bic, form, error in found
    ]


def _suggestion(
    problem: Problem,
    curve: EmpiricalCurve,
    term: Term,
    sums: CovariateSums,
    found: FittedForm,
    error: float,
    behind: float,
) -> Suggestion:
    """Return a closed form with its parameters, its held-out error, and its BIC less that of the best form."""
    form = found.form
    names = (*form.coefficients, *(("b",) if found.constant else ()), *form.names)
    values = (*found.coefficients, *found.shape)
    stds = standard_deviations(profile(sums), sums.at, found)
    units = _units(found, curve.unit, curve.covariate_unit)
    parameters = {
        name: Parameter(
            float(value), float(value - NINETY_PERCENT_STDS * std), float(value + NINETY_PERCENT_STDS * std), unit
        )
        for name, value, std, unit in zip(names, values, stds, units, strict=True)
    }
    return Suggestion(
        form=form.family,
        equation=_equation(problem, curve, term, found),
        parameters=parameters,
        held_out_rmse=error,
        bic_behind=float(behind),
    )


def _units(found: FittedForm, unit: str, of_x: str) -> tuple[str, ...]:
    """Return the units of the coefficients, of the constant, and of the shape parameters; `of_x` the covariate's."""
    shapes = tuple("1" if name == "p" else of_x for name in found.form.names)
    per = [_per(unit, of_x, "^p" if "p" in found.form.names else found.form.exponent)]
    return (*per * len(found.form.coefficients), *([unit] if found.constant else []), *shapes)


def _per(unit: str, of_x: str, power: float | str) -> str:
    """Return a unit over a power of the covariate's."""
    if isinstance(power, str) or power not in POWERS:
        return divided(unit, of_x, power if isinstance(power, str) else f"^{power:g}")
    if power == 0:
        return unit
    if power > 0:
        return divided(unit, of_x, POWERS[power])
    return product(unit, of_x + POWERS[power]) if of_x else unit


def _equation(problem: Problem, curve: EmpiricalCurve, term: Term, found: FittedForm) -> str:
    """Return the form as text with the channel's name, and the covariate and the factor in the machine's words."""
    word = word_for(term.name, problem.labels)
    x = f"|{word}|" if curve.magnitude else word
    form = TIMES.sub(r"\1 · ", found.form.text.replace("|x|", "x") if curve.magnitude else found.form.text)
    if found.constant:
        form = f"({form}) + b" if "where" in form else f"{form} + b"
    text = X.sub(lambda _: x, form)
    factor = factor_in_words(curve.coupling, problem.simulation.channel)
    return f"Δ{problem.simulation.channel} = " + (_times(text, factor) if factor else text)


def _times(text: str, factor: str) -> str:
    """Return a form as text times a factor; that of a constant needs no brackets."""
    return f"{text} · {factor}" if text == "c" else f"({text}) · {factor}"


def factor_in_words(coupling: str, channel: str) -> str:
    """Return the factor by which a curve acts, as text; empty where there is none."""
    if coupling in {"offset", EACH_WAY}:
        return ""
    if coupling == "gain":
        return f"{channel} predicted"
    contrast = coupling.removeprefix(ALONG) if coupling.startswith(ALONG) else ""
    return "sign(motion)" + (f" · ({contrast})" if contrast else "")
