"""Empirical curves on their way into a corrected simulation: new ones, changed ones, and sums of two over one range."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.empirical.stated import name_of
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.regression.groups.lagged_groups import LAGGED

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.answer import Answer, Evidence
    from regolithd.calibration.mismatch.contribution import Contribution
    from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve, StatedCurve


def with_curves(
    answer: Answer, evidence: Evidence
) -> tuple[Mapping[str, float], tuple[Contribution, ...], list[StatedCurve]]:
    """Return parameters, terms and curves of the fits with an empirical curve; of several channels, of all.

    Raises
    ------
    SimulationError
        When what is unexplained follows time, or is in proportion to a channel whose zero means nothing: on another
        recording that curve means nothing. When it follows what was before, or acts on a state: that is no curve.
    """
    shown = (evidence, *evidence.others)
    found = [fit for each in shown for fit in each.empirical]
    if any(place.covariate == "time" for place in answer.unexplained):
        raise SimulationError(
            "--empirical: what is unexplained follows time, and a curve over the time of one recording says nothing of "
            "another; leave --empirical out"
        )
    if any(place.covariate in LAGGED for place in answer.unexplained):
        raise SimulationError(
            "--empirical: what is unexplained follows what was before, and that is no curve; leave --empirical out"
        )
    if any(place.curve is None for place in answer.unexplained):
        raise SimulationError(
            "--empirical: what is unexplained acts on a state of the simulation, and no curve over it is fitted; leave "
            "--empirical out"
        )
    for each in shown:
        arbitrary = each.problem is not None and each.problem.arbitrary_zero
        if arbitrary and any(fit.curve.curve.coupling == "gain" for fit in each.empirical):
            raise SimulationError(
                f"--empirical: the curve is in proportion to {each.channel}, whose zero means nothing; leave it out"
            )
    if len(shown) == 1 and len(found) == 1:
        return found[0].values, found[0].contributions, [found[0].curve]
    fitted = {fit.curve.channel: fit.contributions for fit in found}
    kept = [term for term in evidence.contributions if term.channel not in fitted]
    terms = (*kept, *(term for terms in fitted.values() for term in terms))
    # Named effects first, in the answer's order, then changes, as in the evidence.
    order = {(term.channel, term.name, term.wheels): k for k, term in enumerate(evidence.contributions)}
    terms = tuple(sorted(terms, key=lambda term: order[term.channel, term.name, term.wheels]))
    return evidence.values, terms, [fit.curve for fit in found]


def with_changed_sizes(
    curves: Sequence[StatedCurve], changes: Sequence[Contribution]
) -> tuple[list[StatedCurve], list[Contribution]]:
    """Return the curves with what changed of them, and the changes that are of other effects."""
    by_place = {(name_of(each), each.wheels): each for each in curves}
    rest = []
    for change in changes:
        place = (change.name, change.wheels)
        if place in by_place:
            of = by_place[place]
            by_place[place] = replace(of, curve=times(of.curve, 1 + change.coefficients[0]))
        else:
            rest.append(change)
    return list(by_place.values()), rest


def times(curve: EmpiricalCurve, factor: float) -> EmpiricalCurve:
    """Return a curve of another size."""
    value, low, high = (tuple(factor * each for each in row) for row in (curve.value, curve.low, curve.high))
    ends = (low, high) if factor >= 0 else (high, low)
    return replace(curve, value=value, low=ends[0], high=ends[1])


def summed(curves: Sequence[StatedCurve]) -> list[StatedCurve]:
    """Return the curves with those of one channel, covariate, coupling and wheels put together."""
    found: dict[tuple[str, str, tuple[int | str, ...]], StatedCurve] = {}
    for each in curves:
        place = (each.channel, name_of(each), each.wheels)
        present = found.get(place)
        found[place] = each if present is None else replace(each, curve=plus(present.curve, each.curve))
    return list(found.values())


def plus(one: EmpiricalCurve, other: EmpiricalCurve) -> EmpiricalCurve:
    """Return the sum of two curves over both their ranges, their errors being independent."""
    at = np.union1d(one.at, other.at)
    values = [np.interp(at, curve.at, curve.value) for curve in (one, other)]
    reach = [np.interp(at, curve.at, np.subtract(curve.high, curve.low) / 2) for curve in (one, other)]
    value, half = values[0] + values[1], np.hypot(*reach)
    return replace(
        other,
        at=tuple(at.tolist()),
        value=tuple(value.tolist()),
        low=tuple((value - half).tolist()),
        high=tuple((value + half).tolist()),
    )
