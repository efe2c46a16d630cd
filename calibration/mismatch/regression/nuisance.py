"""Nuisance parameters: the simulation's free parameters, fitted with every set of terms and held by their priors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import as_shown
from regolithd.calibration.mismatch.problem.prior import own_name
from regolithd.calibration.mismatch.problem.state.initial_states import initial_states

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from regolithd.calibration.mismatch.problem.prior import Prior
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.problem.state.initial_states import InitialState
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.thresholds import Thresholds

Array = NDArray[np.float64]

EXACT = 1e12
"""Prior precision of a scaled coefficient that counts as known exactly."""
LEAST_KNOWN = 0.5
"""Posterior variance of a parameter over its prior's, up to which the readings know it as well as its prior does."""


@dataclass(frozen=True)
class Nuisance:
    """Where the free parameters' tangents are in the design matrix, and how firmly their priors hold them.

    Attributes
    ----------
    names: of the parameters; a wheel's own deviation is named by `own_name`
    columns: indices in the design matrix
    precision: one over the prior variance of each scaled coefficient, shape (parameter,)
    centre: the prior's mean of each scaled coefficient: 0 at the stated values, shape (parameter,)
    stated: those of the names that are sizes of effects which the simulation was corrected by
    own: parameter and wheel of each wheel's own deviation, by its name
    states: the initial states of runs, whose names are last
    """

    names: tuple[str, ...]
    columns: tuple[int, ...]
    precision: Array
    centre: Array
    stated: frozenset[str] = frozenset()
    own: Mapping[str, tuple[str, int | str]] = field(default_factory=dict)
    states: tuple[InitialState, ...] = ()

    @property
    def count(self) -> int:
        """How many there are without initial states, which another recording does not have."""
        return len(self.names) - len(self.states)

    def with_precision(self, place: int, value: float) -> Nuisance:
        """Return the same parameters with another precision of one of them."""
        precision = self.precision.copy()
        precision[place] = value
        return replace(self, precision=precision)

    def widened(self, places: Collection[int], problem: Problem) -> Nuisance:
        """Return the same parameters, the priors of some as wide as a wrong statement goes."""
        precision = self.precision.copy()
        for place in places:
            precision[place] /= self.reach(place, problem) ** 2
        return replace(self, precision=precision)

    def reach(self, place: int, problem: Problem) -> float:
        """Return how far one of the simulation's own parameters is off if it is wrong [standard deviations]."""
        return self._prior(place, problem).reach(problem.thresholds.furthest_linearisation_stds)

    def furthest(self, place: int, problem: Problem) -> float:
        """Return how far it may be off at most [standard deviations]."""
        return self._prior(place, problem).furthest(problem.thresholds.furthest_linearisation_stds)

    def _prior(self, place: int, problem: Problem) -> Prior:
        """Return the prior of a parameter; of a wheel's own deviation that of the wheel's value."""
        name, parameters = self.names[place], problem.simulation.parameters
        if name in self.own:
            return parameters[self.own[name][0]].of_one_wheel(problem.thresholds.own_share)
        return parameters[name]

    def prior_stds_away(self, fit: Fit) -> Array:
        """Return how far each parameter is from its prior in a fit, in the prior's standard deviations."""
        fitted = fit.coefficients[: len(self.columns)]
        return np.asarray(np.abs(fitted - self.centre) * np.sqrt(self.precision))

    def contradicting_their_priors(self, fit: Fit, problem: Problem) -> NDArray[np.int64]:
        """Return the places of the simulation's own parameters whose priors the readings contradict in a fit."""
        beyond = self._contradicted(fit, problem)
        return np.array([place for place in self.told(problem) if beyond[place]], np.int64)

    def contradicting_deviations(self, fit: Fit, problem: Problem) -> list[int]:
        """Return the places of told parameters' wheels whose own deviations the readings contradict in a fit."""
        beyond, parameters = self._contradicted(fit, problem), problem.simulation.parameters
        of = [(place, self.own[name][0]) for place, name in enumerate(self.names) if name in self.own]
        return [place for place, name in of if beyond[place] and parameters[name].told]

    def _contradicted(self, fit: Fit, problem: Problem) -> NDArray[np.bool_]:
        variance = np.diag(fit.covariance)[: len(self.columns)] * self.precision
        return beyond_prior_predictive(self.prior_stds_away(fit), variance, problem.thresholds)

    def leaving_their_priors(self, fit: Fit, problem: Problem) -> NDArray[np.int64]:
        """Return the places of the simulation's own parameters that are beyond their priors in a fit."""
        beyond = self.prior_stds_away(fit) > problem.thresholds.furthest_prior_stds
        return np.array([place for place in self.told(problem) if beyond[place]], np.int64)

    def told(self, problem: Problem) -> list[int]:
        """Return the places of the simulation's own parameters that an answer tells."""
        parameters = problem.simulation.parameters
        return [place for place, name in enumerate(self.names) if name in parameters and parameters[name].told]


def beyond_prior_predictive(away: Array, variance: Array, thresholds: Thresholds) -> NDArray[np.bool_]:
    """Return which parameters' priors the readings contradict.

    Where the readings know a parameter no better than its prior does, the prior holds it half way back. A shift
    from the prior has the prior's variance less the posterior's, if the prior is right (Box 1980); of the
    posterior's variance at most half the prior's counts: readings that say less contradict nothing.

    Parameters
    ----------
    away: how far each posterior mean is from its prior's, in the prior's standard deviations, shape (parameter,)
    variance: of each posterior over that of its prior, shape (parameter,)
    """
    known = np.clip(variance, 0.0, LEAST_KNOWN)
    return np.asarray(away / np.sqrt(1 - known) > thresholds.furthest_prior_stds)


def with_nuisance(design: DesignMatrix) -> tuple[DesignMatrix, Nuisance]:
    """Add ∂prediction/∂parameter of every parameter whose prior has a spread, and of each wheel's own deviation.

    Last, what the initial states of runs change.
    """
    names, stds, columns = tangents(design.problem)
    states = tuple(initial_states(design.problem))
    names, stds = [*names, *(state.name for state in states)], [*stds, *(state.std for state in states)]
    columns = [*columns, *as_shown(design.problem, [state.column for state in states])]
    own = _own_deviations(design.problem)
    away = np.array(from_priors(design.problem, names))
    design, places = design.extended(columns)
    # The coefficient of a column that was divided by its scale is the parameter's shift times that scale.
    precision = 1 / (np.array(stds) * design.scale[list(places)]) ** 2 if places else np.zeros(0)
    centre = away * design.scale[list(places)] if places else np.zeros(0)
    about = stated_names(design.problem)
    stated = frozenset(name for name in names if name.startswith(about))
    return design, Nuisance(tuple(names), places, precision, centre, stated, own, states)


def from_priors(problem: Problem, names: Sequence[str]) -> list[float]:
    """Return how far the means of priors are from where the problem is linearised, without any own deviation."""
    parameters = problem.simulation.parameters
    stated = {name: parameters[of].own_of(wheel) for name, (of, wheel) in _own_deviations(problem).items()}
    stated |= {name: prior.value - problem.values[name] for name, prior in parameters.items() if name in names}
    return [stated.get(name, 0.0) for name in names]


def _own_deviations(problem: Problem) -> dict[str, tuple[str, int | str]]:
    """Return parameter and wheel of each wheel's own deviation of a free parameter, by its name."""
    simulation, wheels = problem.simulation, problem.recording.wheels
    own = [name for name in problem.free if name in simulation.own_to_each_wheel] if len(wheels) > 1 else []
    return {own_name(name, wheel): (name, wheel) for name in own for wheel in wheels}


def tangents(problem: Problem) -> tuple[list[str], list[float], list[Array]]:
    """Return names, prior standard deviations and tangents, shape (time, wheel) each."""
    simulation, wheels = problem.simulation, problem.recording.wheels
    free = {name: simulation.parameters[name].std for name in problem.free}
    names, stds = list(free), list(free.values())
    found = list(as_shown(problem, [problem.tangent(name) for name in free]))
    of_parameter = dict(zip(names, found, strict=True))
    for own, (name, wheel) in _own_deviations(problem).items():
        names.append(own)
        stds.append(simulation.parameters[name].of_one_wheel(problem.thresholds.own_share).std)
        found.append(np.where(np.array(wheels) == wheel, of_parameter[name], 0.0))
    for effect, about in zip(problem.stated, stated_names(problem), strict=True):
        if effect.relative_std > 0 and about not in problem.held:
            names, stds, found = [*names, about], [*stds, effect.relative_std], [*found, effect.column]
        names += [f"{about}, {number}" for number in range(1, len(effect.deviations) + 1)]
        stds += [1.0] * len(effect.deviations)
        found += effect.deviations
    return names, stds, found


def stated_names(problem: Problem) -> tuple[str, ...]:
    """Return the nuisance parameters' names of the relative sizes of effects that the simulation was corrected by.

    Effects of one name, on other wheels or of other columns that are late, are numbered.
    """
    names = [effect.name for effect in problem.stated]
    return tuple(
        f"{name} as corrected" + (f" ({place + 1})" if names.count(name) > 1 else "")
        for place, name in enumerate(names)
    )
