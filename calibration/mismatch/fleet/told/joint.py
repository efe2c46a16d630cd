"""The parameters of a fleet whose simulation predicts several channels: what all of them know together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.fleet.told.answer import FleetParameter
from regolithd.calibration.mismatch.fleet.told.findings import owners_of
from regolithd.calibration.mismatch.inference.parameters.joint_parameters import Information, joint_posterior
from regolithd.calibration.mismatch.inference.parameters.parameter_information import SINGULAR
from regolithd.calibration.mismatch.regression.screening.schur import pseudo_inverse

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.fleet.told.chosen import Chosen


def joint_parameters(channels: Sequence[Chosen]) -> tuple[FleetParameter, ...]:
    """Return each parameter of the fleet, or of each rover, from the readings of all channels; of recordings, none."""
    priors = channels[0].simulation.parameters
    return tuple(
        FleetParameter(**vars(told), rovers=rovers)
        for owner, rovers in enumerate(owners_of(channels[0]))
        for told in joint_posterior(priors, [_information(each, owner) for each in channels]).parameters(priors)
    )


def _information(chosen: Chosen, owner: int) -> Information:
    """Return what a channel's readings know of one owner's parameters, beside all that was found in it."""
    equations, fit, priors = chosen.beside.equations, chosen.beside.fit, chosen.simulation.parameters
    names = tuple(name for name in equations.tangents if name in priors)
    at = [owner * len(equations.tangents) + equations.tangents.index(name) for name in names]
    covariance = fit.covariance[np.ix_(at, at)]
    variances = np.diag(covariance)
    # Their standard deviations as they are told, with what the noise's memory adds.
    by = np.where(variances > 0, chosen.beside.stds[at] / np.sqrt(np.where(variances > 0, variances, 1.0)), 0.0)
    known = pseudo_inverse(covariance * np.outer(by, by), SINGULAR)
    matrix = known - np.diag(equations.parameter_factors[2][at])
    stated = np.array([priors[name].value for name in names])
    return Information(names, matrix, known @ fit.coefficients[at] + matrix @ stated, {})
