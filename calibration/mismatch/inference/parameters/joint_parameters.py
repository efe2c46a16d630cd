"""The simulation's parameters from several channels together: one likelihood, and the stated priors once.

Each channel says what its readings know of all parameters: the information matrix and vector of its normal equations
beside all that was found there. Intervals of single parameters lose how they depend on each other, by which channels
that each know a combination of them know every one. Informations of channels with independent noise add.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import CalibratedParameter
from regolithd.calibration.mismatch.inference.parameters.parameter_information import SINGULAR, parameter_information
from regolithd.calibration.mismatch.regression.nuisance import beyond_prior_predictive
from regolithd.calibration.mismatch.regression.screening.schur import pseudo_inverse
from regolithd.calibration.mismatch.selection.plausibility.released_parameters import price_of_wrong_statement
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.inference.uncertainty.intervals import Drawn
    from regolithd.calibration.mismatch.problem.prior import Prior
    from regolithd.calibration.mismatch.selection.decision import Decision, FitQuality

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Information:
    """What the readings of one channel know of the simulation's parameters, without any prior of these.

    Their log likelihood is −½ xᵀ M x + vᵀ x, with x the parameters in their own units.

    Attributes
    ----------
    names: of the parameters
    matrix: M, shape (parameter, parameter)
    vector: v, shape (parameter,)
    held: those that the comparison held at a value because of their bounds
    quality: how well all that was found explains the channel; None: not known
    """

    names: tuple[str, ...]
    matrix: Array
    vector: Array
    held: Mapping[str, float]
    quality: FitQuality | None = None


def information_of(decision: Decision, drawn: Drawn | None) -> Information:
    """Return what a channel's readings know of the parameters, beside all that was found in it."""
    equations, problem = decision.equations, decision.equations.problem
    nuisance, priors = equations.nuisance, problem.simulation.parameters
    kept = [place for place, name in enumerate(nuisance.names) if name in priors]
    names = tuple(nuisance.names[place] for place in kept)
    matrix, moment = parameter_information(decision, drawn, kept)
    scale = equations.design.scale[[nuisance.columns[place] for place in kept]]
    matrix, moment = matrix * np.outer(scale, scale), moment * scale
    at = np.array([problem.values[name] for name in names], np.float64)
    held = {name: problem.values[name] for name in problem.held & set(problem.values)}
    return Information(names, matrix, moment + matrix @ at, held, decision.quality)


@dataclass(frozen=True, eq=False)
class JointPosterior:
    """Where all channels together have the parameters.

    Attributes
    ----------
    names: of the parameters
    shifts: from the stated values, in standard deviations of the stated priors, shape (parameter,)
    covariance: of the shifts, shape (parameter, parameter)
    evidence: minus the χ² of readings and priors, less what parameters outside of their priors are charged, but for a
        constant
    held: values of parameters that a channel's comparison held because of their bounds
    released: the parameters whose stated priors the readings contradict, and do not hold them
    """

    names: tuple[str, ...]
    shifts: Array
    covariance: Array
    evidence: float
    held: Mapping[str, float]
    released: tuple[str, ...] = ()

    @property
    def stds(self) -> Array:
        """Standard deviations of the shifts, in those of the stated priors."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def too_far(self, priors: Mapping[str, Prior]) -> bool:
        """Return whether a released parameter goes further than a wrong statement explains."""
        shifts = dict(zip(self.names, np.abs(self.shifts).tolist(), strict=True))
        stds = THRESHOLDS.furthest_linearisation_stds
        return any(shifts[name] > priors[name].furthest(stds) for name in self.released)

    def restated(self, priors: Mapping[str, Prior]) -> dict[str, tuple[float, float]]:
        """Return mean and standard deviation of the released parameters, had they been stated where they are."""
        values = self.values(priors)
        return {name: (values[name], priors[name].std) for name in self.released}

    def values(self, priors: Mapping[str, Prior]) -> dict[str, float]:
        """Return the values of the free parameters."""
        shifts = zip(self.names, self.shifts.tolist(), strict=True)
        return {name: priors[name].value + shift * priors[name].std for name, shift in shifts}

    def parameters(self, priors: Mapping[str, Prior]) -> tuple[CalibratedParameter, ...]:
        """Return the told parameters; those that are exact or held have no width."""
        places = {name: place for place, name in enumerate(self.names)}
        found = []
        for name, prior in priors.items():
            value, std = self.held.get(name, prior.value), 0.0
            if name in places:
                value = prior.value + float(self.shifts[places[name]]) * prior.std
                std = float(self.stds[places[name]]) * prior.std
            reach = NINETY_PERCENT_STDS * std
            if prior.told:
                found.append(
                    CalibratedParameter(name, prior.unit, prior.value, prior.std, value, value - reach, value + reach)
                )
        return tuple(found)


def joint_posterior(
    priors: Mapping[str, Prior], informations: Sequence[Information], *, may_release: bool = True
) -> JointPosterior:
    """Return the posterior of the parameters from all channels and their stated priors.

    Where the channels together contradict a prior, it is released as in one channel: if the evidence is larger by
    `lead_margin` even after what a wrong statement is charged, and no parameter goes further than a wrong statement
    explains. Of parameters that could stand for each other the one with most evidence is released, or all together.
    """
    likelihood = Likelihood.of(priors, informations)
    within = likelihood.posterior(())
    if not may_release:
        return within
    beyond = beyond_prior_predictive(np.abs(within.shifts), within.stds**2, THRESHOLDS)
    contradicted = np.flatnonzero(beyond & np.array([priors[name].told for name in within.names], bool)).tolist()
    sets = dict.fromkeys([*((place,) for place in contradicted), tuple(contradicted)])
    found = [likelihood.posterior(places) for places in sets if places]
    needed = within.evidence + THRESHOLDS.lead_margin
    plausible = [each for each in found if not each.too_far(priors) and each.evidence > needed]
    return max(plausible, key=lambda each: each.evidence, default=within)


def gained_by_release(priors: Mapping[str, Prior], informations: Sequence[Information]) -> dict[str, float]:
    """Return the evidence that releasing each told parameter by itself gains, what a wrong statement costs included."""
    likelihood = Likelihood.of(priors, informations)
    within = likelihood.posterior(()).evidence
    told = [(place, name) for place, name in enumerate(likelihood.names) if priors[name].told]
    return {name: likelihood.posterior((place,)).evidence - within for place, name in told}


def known_better_by_others(
    own: JointPosterior, others: JointPosterior, priors: Mapping[str, Prior]
) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation of the hardly known parameters that other channels know better than one.

    `own` is the posterior of that channel, `others` that of all others together.
    """
    stds = dict(zip(own.names, own.stds.tolist(), strict=True))
    values = others.values(priors)
    return {
        name: (values[name], std * priors[name].std)
        for name, std in zip(others.names, others.stds.tolist(), strict=True)
        if priors[name].is_hardly_known and std < stds.get(name, 0.0)
    }


@dataclass(frozen=True, eq=False)
class Likelihood:
    """The channels' informations together, of shifts from the stated values in standard deviations of the priors."""

    names: tuple[str, ...]
    matrix: Array
    vector: Array
    held: Mapping[str, float]
    reach: Array

    @classmethod
    def of(cls, priors: Mapping[str, Prior], informations: Sequence[Information]) -> Likelihood:
        """Return the sum; a parameter that a channel holds at a value has it in all."""
        held = {name: value for each in informations for name, value in each.held.items()}
        names = tuple(name for name, prior in priors.items() if prior.std > 0 and name not in held)
        matrix, vector = np.zeros((len(names), len(names))), np.zeros(len(names))
        for each in informations:
            kept = [place for place, name in enumerate(each.names) if name in names]
            at = [names.index(each.names[place]) for place in kept]
            std = np.array([priors[names[place]].std for place in at])
            about = np.array([held.get(name, priors[name].value) for name in each.names])
            matrix[np.ix_(at, at)] += each.matrix[np.ix_(kept, kept)] * np.outer(std, std)
            vector[at] += (each.vector - each.matrix @ about)[kept] * std
        reach = np.array([priors[name].reach(THRESHOLDS.furthest_linearisation_stds) for name in names])
        return cls(names, matrix, vector, held, reach)

    def posterior(self, released: Sequence[int]) -> JointPosterior:
        """Return the posterior with the priors of some parameters as wide as a wrong statement goes."""
        precision = np.ones(len(self.names))
        precision[list(released)] = self.reach[list(released)] ** -2.0
        covariance = pseudo_inverse(self.matrix + np.diag(precision), SINGULAR)
        shifts = covariance @ self.vector
        away = np.delete(shifts, list(released))
        chi2 = shifts @ self.matrix @ shifts - 2 * self.vector @ shifts + away @ away
        evidence = -float(chi2) - sum(
            price_of_wrong_statement(abs(float(shifts[place])), float(self.reach[place])) for place in released
        )
        names = tuple(self.names[place] for place in released)
        return JointPosterior(self.names, shifts, covariance, evidence, self.held, names)

    def evidence_without_priors(self) -> float:
        """Return minus the least χ² of the readings alone, of parameters anywhere that a wrong statement goes to."""
        shifts = pseudo_inverse(self.matrix + np.diag(self.reach**-2.0), SINGULAR) @ self.vector
        return float(2 * self.vector @ shifts - shifts @ self.matrix @ shifts)
