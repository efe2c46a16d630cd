"""Wheels whose own value of a parameter is further from the common one than their prior lets expect.

A wheel of a parameter that is `own_to_each_wheel` has a deviation of its own, which is held near 0. Where the readings
contradict that, the deviation was fitted without it (`selection/plausibility/released_parameters.py`), and is told: as
a note, and as a finding where it is as far as the common value of a finding is from its statement.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import CalibratedParameter
from regolithd.calibration.mismatch.inference.evidence import calibrated_values
from regolithd.calibration.mismatch.inference.statements import after_number
from regolithd.calibration.mismatch.regression.nuisance import beyond_prior_predictive
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.selection.decision import Decision

Array = NDArray[np.float64]


def own_values(decision: Decision, covariance: Array) -> tuple[CalibratedParameter, ...]:
    """Return the wheels' own values that the readings contradict, beside the common value as their prior.

    `covariance` is that of all coefficients of the decision's fit (`parameter_covariance`).
    """
    equations, fit = decision.equations, decision.whole
    problem, nuisance = equations.problem, equations.nuisance
    values, found = calibrated_values(equations, fit), []
    for name, (parameter, wheel) in nuisance.own.items():
        prior = problem.simulation.parameters[parameter]
        both = [nuisance.names.index(each) for each in (parameter, name)]
        per_unit = 1 / equations.design.scale[[nuisance.columns[each] for each in both]]
        variances = covariance[np.ix_(both, both)] * np.outer(per_unit, per_unit)
        std = prior.of_one_wheel(problem.thresholds.own_share).std  # also where the fit was not held by it
        away = abs(values[name] - prior.own_of(wheel)) / std
        left = np.array([variances[1, 1] / std**2])
        if prior.told and beyond_prior_predictive(np.array([away]), left, problem.thresholds)[0]:
            value, common = values[parameter] + values[name], values[parameter] + prior.own_of(wheel)
            reach = NINETY_PERCENT_STDS * float(np.sqrt(max(variances.sum(), 0.0)))
            found.append(CalibratedParameter(name, prior.unit, common, std, value, value - reach, value + reach))
    return tuple(found)


def far_enough(decision: Decision, values: Sequence[CalibratedParameter]) -> tuple[CalibratedParameter, ...]:
    """Return those of wheels' own values that are as far as a common value that is a finding."""
    limits = decision.equations.thresholds
    return tuple(each for each in values if each.prior_stds_away * limits.own_share > limits.furthest_prior_stds)


def notes_on_own_values(decision: Decision, values: Sequence[CalibratedParameter]) -> list[str]:
    """Return a note on each wheel's own value that is further away than usual, and no finding.

    And on each stated deviation of a wheel that the recording does not have.
    """
    problem, findings = decision.equations.problem, far_enough(decision, values)
    wheels = {str(wheel) for wheel in problem.recording.wheels}
    parameters = problem.simulation.parameters
    unknown = [(name, wheel) for name, prior in parameters.items() for wheel, _ in prior.own if wheel not in wheels]
    told = [
        f"{each.name} is {each.value:.4g}{after_number(each.unit)}, and in common it is {each.prior:.4g}: "
        f"{each.prior_stds_away:.1f} standard deviations of what one alone deviates "
        f"({float(f'{each.prior_std:.2g}'):g}). Check it."
        for each in values
        if each not in findings
    ]
    return told + [f"{name} has a deviation of {wheel}, which the recording does not have." for name, wheel in unknown]
