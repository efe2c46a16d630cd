"""Calibration: the problem is posed anew where the fit of the parameters leads.

The engine fits the parameters by the tangents of the prediction. Where those, over the distance that a parameter moves,
differ from what the simulation itself predicts, the problem is posed again at the new values, with the priors as stated
(Gauss and Newton's method), until the two agree: what the answer calls calibrated has been run. It is searched again
where what was found makes the prediction another one, as some effects are a share of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.candidates.sensor_delay import as_shown
from regolithd.calibration.mismatch.regression.equations import free_parameter_equations, smooth_equations
from regolithd.calibration.mismatch.regression.nuisance import stated_name
from regolithd.calibration.mismatch.selection.noise_estimation import fit_of_significant_terms

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

    Array = NDArray[np.float64]

ON_TIME_WITHIN = 0.5
"""Readings by which an input that was put on time may still be late (a choice: what sampling leaves open)."""
STEPS = 10
"""Linearisations at most (a choice: a smooth simulation needs two or three, one that is stated at 0 a few more)."""
HALVINGS = 5
"""Halvings of a step at most (a choice: a thirtieth of the way is left)."""
WORSE = 1.1
"""Power of the residual, over that before a step, from which the step has gone too far (a choice: firm priors may lead
back by a little)."""


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the parameters from where a problem is linearised. The simulation runs once at its end.

    Attributes
    ----------
    problem: where it is linearised
    values: the parameters' at the end of the step
    """

    problem: Problem
    values: Mapping[str, float]

    @cached_property
    def run(self) -> Array:
        """Return the prediction at the end, shape (compared reading,)."""
        return self.problem.changed(**self.values)[self.problem.mask]

    @property
    def begin(self) -> Array:
        """Return the prediction at the beginning, shape (compared reading,)."""
        return self.problem.filled[self.problem.mask]

    @property
    def measured(self) -> Array:
        """Return the readings, shape (compared reading,)."""
        return self.problem.measured[self.problem.mask]

    def is_bent(self) -> bool:
        """Return whether the prediction differs from its tangents by more than the noise lets pass."""
        problem = self.problem
        shifts = {name: at - problem.values[name] for name, at in self.values.items() if at != problem.values[name]}
        if not shifts:
            return False
        along = problem.filled + sum(shift * problem.tangent(name) for name, shift in shifts.items())
        apart = self.run - along[problem.mask]
        if not np.isfinite(apart).all():
            return False
        return _power(apart) > problem.thresholds.linearisation_share**2 * _power(self.measured - self.run)

    def leads_to_another_law(self) -> bool:
        """Return whether what is a share of the prediction, such as a loss, would have another law at the end.

        That is where the prediction changes by more than may be missed of a law.
        """
        share = self.problem.thresholds.form_misfit
        return bool(np.isfinite(self.run).all()) and _power(self.run - self.begin) > share * _power(self.run)

    def damped(self) -> Mapping[str, float]:
        """Return the values at the end, the step halved until the simulation fits the recording no worse than before.

        Tangents at a value of 0, where a part of the simulation does nothing, may lead anywhere.
        """
        step, most = self, WORSE * _power(self.measured - self.begin)
        for _ in range(HALVINGS):
            if np.isfinite(step.run).all() and _power(self.measured - step.run) <= most:
                break
            step = replace(
                step, values={name: (self.problem.values[name] + at) / 2 for name, at in step.values.items()}
            )
        return step.values


def linearised_where_it_fits(pose: Callable[[Mapping[str, float] | None], Problem]) -> NormalEquations:
    """Return the equations of parameters and smooth curves, linearised where they fit the recording best.

    The parameters are fitted alone first, then beside the curves.

    An effect that is left out moves the parameters. Curves over the covariates hold most of it, whatever it is, so that
    the search for its name begins where it will end. `pose` builds the problem at given values, or at the stated ones.
    """
    problem = pose(None)
    for _ in range(STEPS):
        equations = free_parameter_equations(problem)
        step = Step(problem, moved_values(equations, equations.fit(())))
        if not step.is_bent():
            break
        problem = pose(step.damped())
    equations = smooth_equations(problem)
    step = Step(problem, moved_values(equations, fit_of_significant_terms(equations)))
    return smooth_equations(pose(step.values)) if step.is_bent() else equations


def moved_values(equations: NormalEquations, fit: Fit) -> dict[str, float]:
    """Return the parameters' values in a fit, without the wheels' own deviations, as far as they may be moved."""
    problem = equations.problem
    priors, limits = problem.simulation.parameters, problem.thresholds.furthest_linearisation_stds
    return {**problem.values, **{name: priors[name].near(at, limits) for name, at in _fitted(equations, fit).items()}}


def out_of_bounds(equations: NormalEquations, fit: Fit) -> frozenset[str]:
    """Return the parameters that a fit moves further out of their bounds than noise does."""
    priors = equations.problem.simulation.parameters
    return frozenset(name for name, at in _fitted(equations, fit).items() if priors[name].out_of_bounds(at))


def beyond_their_doubt(equations: NormalEquations, fit: Fit) -> frozenset[str]:
    """Return the sizes of corrected effects that a fit moves further than their uncertainty: they have changed.

    A change is looked for beside what the uncertainty allows, and would hardly be seen beside it.
    """
    nuisance, furthest = equations.nuisance, equations.thresholds.furthest_prior_stds
    sizes = {stated_name(effect.name) for effect in equations.problem.stated}
    away = zip(nuisance.names, nuisance.prior_stds_away(fit), strict=True)
    return frozenset(name for name, stds in away if name in sizes and stds > furthest)


def _fitted(equations: NormalEquations, fit: Fit) -> dict[str, float]:
    """Return the values of the free parameters in a fit."""
    problem, nuisance = equations.problem, equations.nuisance
    return {
        name: problem.values[name] + float(fit.coefficients[place] / equations.design.scale[nuisance.columns[place]])
        for place, name in enumerate(nuisance.names)
        if name in problem.simulation.parameters
    }


def _power(values: Array) -> float:
    """Return the mean square."""
    return float(np.mean(values**2))


def late_otherwise(problem: Problem, values: Mapping[str, float]) -> bool:
    """Return whether a late channel changes by more, or less, than at the problem's values: its size would be wrong."""
    here, there = problem.filled, problem.changed(**values)
    shown = as_shown(problem, [here, there])
    now, then = ((late - at)[problem.mask] for late, at in zip(shown, (here, there), strict=True))
    share = problem.thresholds.size_discrepancy_std
    return _power(then - now) > share**2 * _power(now)


def put_on_time_by(problem: Problem, late: Mapping[str, float]) -> bool:
    """Return whether a problem has all these inputs on time that are late by so much [s]."""
    within = ON_TIME_WITHIN * problem.recording.step_s
    return all(abs(delay - problem.on_time.get(name, 0.0)) <= within for name, delay in late.items())
