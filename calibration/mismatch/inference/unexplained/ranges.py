"""The range of a covariate to which something is confined: its bounds with their intervals, and a sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.answer import Parameter, Range
from regolithd.calibration.mismatch.inference.rounding import with_interval
from regolithd.calibration.mismatch.problem.words import ANGULAR_SPEED, unit_in_label, word_for
from regolithd.calibration.mismatch.selection.by_region.region_bounds import bounds_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.answer import Unexplained
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision

CLOSE_TO_NUMBER = ("°", "%")
"""Units that stand at their number without a space."""


def range_of(decision: Decision, term: Term) -> Range | None:
    """Return the range of a term that is confined to one; else None."""
    region = term.group.region
    if region is None:
        return None
    whole, problem = decision.whole, decision.equations.problem
    unit = covariate_unit(problem, region.covariate)
    lower, upper = (
        None if bound is None else Parameter(bound.value, bound.low, bound.high, unit)
        for bound in bounds_of(decision.equations, whole, whole.terms.index(term))
    )
    return Range(region.covariate, lower, upper, in_words(region.covariate, lower, upper, problem))


def notes_on_confined_laws(decision: Decision, told: Sequence[Unexplained]) -> tuple[str, ...]:
    """Return a note on each law of the library that explains a range better than any does that acts everywhere.

    `told` is what is unexplained, in the decision's order.
    """
    places, notes = list(zip(decision.unnamed, told, strict=True)), []
    for each in decision.confined:
        candidate, where = (
            each.law.group.candidate,
            next((place.range for term, place in places if term is each.region), None),
        )
        if candidate is not None and where is not None:
            notes.append(
                f"Of the library's laws, {candidate.label} explains best what acts only "
                f"{_place_in_words(where.covariate, where.lower, where.upper, decision.equations.problem)}: "
                f"{candidate.words_for(each.law.group.shape)}. Where it acts everywhere, no law explains as much."
            )
    return tuple(notes)


def covariate_unit(problem: Problem, covariate: str) -> str:
    """Return a covariate's unit, as its label has it in brackets; 1 where it is not known."""
    if unit := unit_in_label(covariate, problem.labels):
        return unit
    if covariate == "wheel_speed":
        return ANGULAR_SPEED
    return problem.simulation.unit if covariate == "torque" else "1"


def in_words(covariate: str, lower: Parameter | None, upper: Parameter | None, problem: Problem) -> str:
    """Return a range in words and the recording's unit: "below 8.2 °C of temperature (90 % sure: 8.0 to 8.4)"."""
    intervals = " and ".join(_told(bound)[1] for bound in (lower, upper) if bound is not None)
    return f"{_place_in_words(covariate, lower, upper, problem)} (90 % sure: {intervals})"


def _place_in_words(covariate: str, lower: Parameter | None, upper: Parameter | None, problem: Problem) -> str:
    """Return the same without how sure it is."""
    bounds = [_told(bound) for bound in (lower, upper) if bound is not None]
    values, unit = [each[0] for each in bounds], bounds[0][2]
    of = "" if covariate == "time" else f" of {word_for(covariate, problem.labels)}"
    between = "" if unit in CLOSE_TO_NUMBER or not unit else " "
    where = f"{' and '.join(values)}{between}{unit}{of}"
    if lower is None:
        return f"{'until' if covariate == 'time' else 'below'} {where}"
    if upper is None:
        return f"from {where} on" if covariate == "time" else f"beyond {where}"
    return f"between {where}"


def _told(bound: Parameter) -> tuple[str, str, str]:
    """Return a bound, its interval, and the unit in which they are told."""
    value, low, high = with_interval(bound.value, bound.low, bound.high)
    unit = {"1": "", "degC": "°C", "deg": "°"}.get(bound.unit, bound.unit)
    return value, f"{low} to {high}", unit
