"""Parameters of rovers that were stated wrongly: their priors are widened, as those of one recording are.

See `selection.released_parameters`: a prior that the recordings contradict would hold the parameter half way back, and
push others out of theirs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.fleet.choice.recordings import shown_beside
from regolithd.calibration.mismatch.inference.parameters.joint_parameters import Information, joint_posterior

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit
    from regolithd.calibration.mismatch.fleet.work.found import Found
    from regolithd.calibration.mismatch.problem.prior import Prior


def with_released(
    equations: FleetEquations, fit: FleetFit, found: Sequence[Found], priors: Mapping[str, Prior]
) -> FleetEquations:
    """Return equations with the priors widened of the parameters that recordings contradict, of each that has its own.

    As of one recording, that has to be all that is wrong: not where one of their recordings has something unexplained.
    """
    shown = shown_beside(equations, fit, found)
    unexplained = {recording for recording, _ in shown.curves}
    for curve in fit.curves:
        unexplained |= set(np.flatnonzero(equations.factors(curve).any(axis=(0, 2))).tolist())
    beside = equations.beside(shown.terms)
    again, count, out = beside.fit(fit.terms), len(equations.tangents), set[int]()
    factors = equations.parameter_factors[1]
    for first in range(0, len(factors), max(count, 1)):
        recordings = np.flatnonzero(factors[first].any(axis=1)).tolist()
        names = set(_own_values([found[each] for each in recordings], priors))
        if unexplained.isdisjoint(recordings):
            names |= set(joint_posterior(priors, [_information(beside, again, first, priors)]).released)
        out |= {first + equations.tangents.index(name) for name in names if name in equations.tangents}
    return replace(equations, released=frozenset(out)) if out else equations


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
