"""What single recordings show beside the effects of the fleet.

A finding of one recording counts if it gains more than was asked of it there, with the fleet's effects in place, and
pays for having been found in one of many recordings; so does its lead over nothing in the recording's own answer, which
knows how slow its noise is. The same curve in several recordings of a rover pays once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.screening.schur import delta_chi2_together
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.answer import Effect, Unexplained
    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit, FleetTerm
    from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shown:
    """Findings with the places of their recordings, and the terms, by recording and place, that they are of.

    `curves` are those of the terms that have no name.
    """

    effects: tuple[tuple[int, Effect], ...]
    unexplained: tuple[tuple[int, Unexplained], ...]
    terms: tuple[tuple[int, int], ...]
    curves: tuple[tuple[int, int], ...]


def shown_beside(equations: FleetEquations, fit: FleetFit, found: Sequence[Found]) -> Shown:
    """Return the effects and structures that recordings show beside the fit.

    Recordings of one rover that show the same curve are judged together: what each gains beyond its cost adds up. A
    fault that another channel shows (its penalty is below 0 for that) has to be significant in the predicted one, too.
    """
    chance = 2 * float(np.log(len(found)))
    gains = {
        (i, k): gain_beside(equations, fit, i, k)
        for i, of_recording in enumerate(found)
        for k, term in enumerate(of_recording.terms)
        if not _is_of_the_fleet(equations, fit, i, term)
    }
    ahead = {(i, k): gain - found[i].terms[k].penalty for (i, k), gain in gains.items()}
    together, leads = dict[object, float](), dict[object, float]()
    for (i, k), score in ahead.items():
        if not found[i].terms[k].named:
            curve = _curve_of(equations, i, found[i].terms[k])
            together[curve] = together.get(curve, 0.0) + max(score, 0.0)
            leads[curve] = leads.get(curve, 0.0) + max(found[i].terms[k].lead, 0.0)
    effects, rest, own, curves = [], [], [], []
    for (i, k), score in ahead.items():
        term, findings = found[i].terms[k], found[i].findings
        if term.named:
            here = gains[i, k] > THRESHOLDS.smooth_term_entry
            if here and score > found[i].entry_threshold + chance and term.lead > chance:
                own.append((i, k))
                effects += [(i, each) for each in findings.effects if each.name == term.name][:1]
            continue
        curve = _curve_of(equations, i, term)
        significant = together[curve] > THRESHOLDS.smooth_term_entry + chance and leads[curve] > chance
        if significant and score > 0:
            own.append((i, k))
            curves.append((i, k))
            place = k - sum(each.named for each in found[i].terms)
            rest += [(i, each) for each in findings.unexplained[place : place + 1]]
    return Shown(tuple(effects), tuple(rest), tuple(own), tuple(curves))


def _curve_of(equations: FleetEquations, recording: int, term: FoundTerm) -> tuple[object, ...]:
    """Return what is one curve in several recordings: its rover, covariate, coupling and wheels."""
    wheels = tuple(equations.sums[recording].wheels[wheel] for wheel in term.wheels)
    return int(equations.rover[recording]), term.name, term.coupling, wheels


def _is_of_the_fleet(equations: FleetEquations, fit: FleetFit, recording: int, term: FoundTerm) -> bool:
    """Return whether an effect of the fleet acts in a recording by the same law: its size there is in the catalogue.

    Of a curve that is one over the same covariate.
    """
    same = [index for index, of_fleet in enumerate(fit.terms) if _is_same(of_fleet, term)]
    wheels = [equations.wheels.index(equations.sums[recording].wheels[wheel]) for wheel in term.wheels]
    return any(fit.factors[fit.spans[index], recording][:, wheels].any() for index in same)


def _is_same(of_fleet: FleetTerm, term: FoundTerm) -> bool:
    """Return whether a term of the fleet and one of a recording are the same law, or curves over one covariate."""
    if of_fleet.group.named != term.named:
        return False
    return term.name == (of_fleet.name if term.named else of_fleet.group.shape["over"])


def gain_beside(equations: FleetEquations, fit: FleetFit, recording: int, index: int) -> float:
    """Return the Δχ² of a term of one recording with the fleet's effects and the parameters that it has there.

    The parameters are as the fleet has them; in this recording they may still move as far as their priors.
    """
    sums = equations.sums[recording]
    own, parameters = list(sums.own[index]), list(range(len(sums.tangents)))
    fleet = _explained(equations, fit, recording)
    weights = sums.weights
    moment = np.einsum("w,wc->c", weights, sums.moment - fleet)
    matrix = np.einsum("w,wcd->cd", weights, sums.gram)
    base = matrix[np.ix_(parameters, parameters)] + np.diag(1 / sums.prior_stds**2)
    cross = matrix[np.ix_(parameters, own)]
    left = moment[own] - cross.T @ np.linalg.solve(base, moment[parameters]) if parameters else moment[own]
    energy = matrix[np.ix_(own, own)]
    complement = energy - cross.T @ np.linalg.solve(base, cross) if parameters else energy
    largest = float(np.max(np.diag(energy)))
    return (
        delta_chi2_together(left, complement, largest, (0,) * len(own), THRESHOLDS.least_tolerance) if largest else 0.0
    )


def _explained(equations: FleetEquations, fit: FleetFit, recording: int) -> Array:
    """Return the moments of a recording's columns with what the fit explains there, shape (wheel, column)."""
    sums = equations.sums[recording]
    found = np.zeros(sums.moment.shape)
    place: dict[int, int] = {}
    for fleet, name in enumerate(equations.tangents):
        if name in sums.tangents:
            place[fleet] = sums.tangents.index(name)
    for group, places in zip(equations.groups, sums.places, strict=True):
        place |= dict(zip(group.columns, places, strict=False))
    for w, wheel in enumerate(sums.wheels):
        factors = fit.factors[:, recording, equations.wheels.index(wheel)]
        for j in np.flatnonzero(factors):
            at = place.get(int(fit.columns[j]))
            if at is not None:
                found[w] += fit.coefficients[j] * factors[j] * sums.gram[w][:, at]
    return found
