"""Parameters of rovers that were stated wrongly: their priors are widened, as those of one recording are.

See `selection.released_parameters`: a prior that the recordings contradict would hold the parameter half way back, and
push others out of theirs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.fleet.choice.recordings import shown_beside
from regolithd.calibration.mismatch.inference.parameters.joint_parameters import (
    Information,
    gained_by_release,
    joint_posterior,
)
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit
    from regolithd.calibration.mismatch.fleet.work.found import Found
    from regolithd.calibration.mismatch.problem.prior import Prior


def with_released(
    equations: FleetEquations, fit: FleetFit, found: Sequence[Found], priors: Mapping[str, Prior]
) -> FleetEquations:
    """Return equations with the priors widened of the parameters that recordings contradict, of each that has its own.

    As of one recording, that has to be all that is wrong: not where one of their recordings has something unexplained.
    A value is stated once for all rovers: where most of them contradict it, it holds none of them.
    """
    shown = shown_beside(equations, fit, found)
    unexplained = {recording for recording, _ in shown.curves}
    for curve in fit.curves:
        unexplained |= set(np.flatnonzero(equations.factors(curve).any(axis=(0, 2))).tolist())
    beside = equations.beside(shown.terms)
    again, count, out = beside.fit(fit.terms), max(len(equations.tangents), 1), set[int]()
    factors, gains = equations.parameter_factors[1], dict[int, dict[str, float]]()
    for first in range(0, len(factors), count):
        recordings = np.flatnonzero(factors[first].any(axis=1)).tolist()
        names = set(_own_values([found[each] for each in recordings], priors))
        if unexplained.isdisjoint(recordings):
            information = _information(beside, again, first, priors)
            names |= set(joint_posterior(priors, [information]).released)
            gains[first] = gained_by_release(priors, [information])
        out |= _places(equations, first, names)
    if equations.level == "rover":
        of_all = [name for name in priors if _is_stated_wrongly(name, gains.values(), len(equations.recordings_of))]
        out = out.union(*(_places(equations, first, of_all) for first in gains))
    return replace(equations, released=frozenset(out)) if out else equations


def _places(equations: FleetEquations, first: int, names: Iterable[str]) -> set[int]:
    """Return the places, among the coefficients, of the parameters of an owner whose coefficients begin at a place."""
    return {first + equations.tangents.index(name) for name in names if name in equations.tangents}


def _is_stated_wrongly(name: str, gains: Collection[Mapping[str, float]], rovers: int) -> bool:
    """Return whether most rovers gain by a parameter's release, and all of them together what one of them has to."""
    of_each = [each.get(name, 0.0) for each in gains]
    return 2 * sum(gain > 0 for gain in of_each) > rovers > 1 and sum(of_each) > THRESHOLDS.lead_margin


def _own_values(found: Sequence[Found], priors: Mapping[str, Prior]) -> list[str]:
    """Return the names of wheels' own values that are a finding in more than half of some recordings by themselves."""
    names = [each.name for one in found for each in one.findings.parameters if each.name not in priors]
    return [name for name in dict.fromkeys(names) if 2 * names.count(name) > len(found)]


def _information(equations: FleetEquations, fit: FleetFit, first: int, priors: Mapping[str, Prior]) -> Information:
    """Return what the recordings know of the parameters whose coefficients begin at a place, without their priors."""
    kept = [k for k, name in enumerate(equations.tangents) if name in priors]
    at, names = [first + k for k in kept], tuple(equations.tangents[k] for k in kept)
    std, about = equations.prior_stds[kept], np.array([priors[name].value for name in names])
    # In standard deviations of the priors, whose precision is then 1.
    posterior = np.linalg.inv(fit.covariance[np.ix_(at, at)] / np.outer(std, std))
    matrix = (posterior - np.eye(len(at))) / np.outer(std, std)
    vector = posterior @ (fit.coefficients[at] / std) / std
    return Information(names, matrix, vector + matrix @ about, {})
