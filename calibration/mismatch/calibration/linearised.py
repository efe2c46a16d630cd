"""Calibration: the problem is posed anew where the fit of the parameters leads.

The engine fits the parameters by the tangents of the prediction. Where those, over the distance that a parameter moves,
differ from what the simulation itself predicts, the problem is posed again at the new values, with the priors as stated
(Gauss and Newton's method), until the two agree: what the answer calls calibrated has been run. It is searched again
where what was found makes the prediction another one, as some effects are a share of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.calibration.starting_values import Start, starting_values
from regolithd.calibration.mismatch.calibration.step import Step, power
from regolithd.calibration.mismatch.candidates.late_columns import as_shown
from regolithd.calibration.mismatch.inference.statements import after_number
from regolithd.calibration.mismatch.regression.equations import free_parameter_equations, smooth_equations
from regolithd.calibration.mismatch.regression.nuisance import stated_names
from regolithd.calibration.mismatch.regression.residuals import contribution
from regolithd.calibration.mismatch.selection.noise_estimation import fit_of_significant_terms

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]

ON_TIME_WITHIN = 0.5
"""Readings by which an input that was put on time may still be late (a choice: what sampling leaves open)."""
STEPS = 10
"""Linearisations at most (a choice: a smooth simulation needs two or three, one that is stated at 0 a few more)."""
STEPS_BESIDE = 3
"""Linearisations beside curves at most (a choice: one is usual)."""
WORSE_BY = 0.01
"""Share by which the error of the simulation alone has to be larger than as stated, to be told (a choice)."""


def linearised_where_it_fits(
    pose: Callable[[Mapping[str, float] | None], Problem], start: Start | None = None
) -> NormalEquations:
    """Return the equations of parameters and smooth curves, linearised where they fit the recording best.

    The parameters are fitted alone first, from `start` (by default that of `starting_values`), then beside the curves.

    An effect that is left out moves the parameters. Curves over the covariates hold most of it, whatever it is, so that
    the search for its name begins where it will end. `pose` builds the problem at given values, or at the stated ones.
    """
    start = start or starting_values(pose(None))
    problem = start.problem if start.values is None else pose(start.values)
    for _ in range(STEPS):
        equations = free_parameter_equations(problem)
        step = Step(problem, moved_values(equations, equations.fit(())))
        if step.is_defined and not step.is_bent():
            break
        problem = pose(step.damped())
    equations = smooth_equations(problem)
    for _ in range(STEPS_BESIDE):
        step = step_to(equations, fit_of_significant_terms(equations))
        if not step.is_bent():
            break
        equations = smooth_equations(pose(step.damped()))
    return equations


def step_to(equations: NormalEquations, fit: Fit) -> Step:
    """Return the step of the parameters to a fit, beside what its terms add."""
    problem = equations.problem
    return Step(problem, moved_values(equations, fit), added_by(equations, fit)[problem.mask])


def worse_than_stated(equations: NormalEquations, fit: Fit, stated: Problem) -> tuple[str, ...]:
    """Return a note where the simulation alone fits worse with the parameters of a fit than with the stated ones.

    Beside a curve parameters go where what the curve leaves is smallest, and nothing holds the sum of both.
    """
    step, as_stated = Step(equations.problem, moved_values(equations, fit)), stated.measured - stated.filled
    now, before = (np.sqrt(power(left)) for left in (step.measured - step.run, as_stated[stated.mask]))
    if not now > (1 + WORSE_BY) * before:
        return ()
    rms = (f"{each:.3g}{after_number(stated.simulation.unit)}" for each in (now, before))
    return (
        "Beside what stays unexplained the parameters are such that the simulation alone is further from the recording "
        "(root mean square {} instead of {} as stated): do not use it with these values.".format(*rms),
    )


def added_by(equations: NormalEquations, fit: Fit) -> Array:
    """Return what the terms of a fit add to the prediction, shape (time, wheel)."""
    terms = (contribution(equations, fit, term) for term in range(len(fit.terms)))
    return sum(terms, np.zeros(equations.problem.mask.shape))


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
    sizes = set(stated_names(equations.problem))
    away = zip(nuisance.names, nuisance.prior_stds_away(fit), strict=True)
    return frozenset(name for name, stds in away if name in sizes and stds > furthest)


def untenable(equations: NormalEquations, fit: Fit) -> frozenset[str]:
    """Return the told parameters that leave their priors, where the simulation does not go along with the fit.

    Its tangents promise what it does not do: the values that were fitted are none. Something else acts, or an input has
    another unit.
    """
    problem, priors, fitted = equations.problem, equations.problem.simulation.parameters, _fitted(equations, fit)
    limits = problem.thresholds
    off = {name: abs(at - priors[name].value) for name, at in fitted.items() if priors[name].told}
    leaving = frozenset(name for name, away in off.items() if away > limits.furthest_prior_stds * priors[name].std)
    if not leaving:
        return leaving
    step = Step(problem, {**problem.values, **fitted})
    missed, promised = power(step.run - step.along), power(step.along - step.begin)
    goes_along = not step.is_bent() or missed <= limits.form_misfit**2 * promised
    return frozenset() if step.is_defined and goes_along else leaving


def unknown_states(equations: NormalEquations, fit: Fit) -> frozenset[str]:
    """Return the initial states that a fit moves further than the noise of a reading does, and were not known to be."""
    nuisance, furthest = equations.nuisance, equations.thresholds.furthest_prior_stds
    away = nuisance.prior_stds_away(fit)[nuisance.count :]
    of_states = zip(nuisance.states, away, strict=True)
    return frozenset(state.name for state, stds in of_states if stds > furthest) - equations.problem.unknown


def _fitted(equations: NormalEquations, fit: Fit) -> dict[str, float]:
    """Return the values of the free parameters in a fit."""
    problem, shifts = equations.problem, equations.shifts_of_parameters(fit).tolist()
    return {
        name: problem.values[name] + shift
        for name, shift in zip(equations.nuisance.names, shifts, strict=True)
        if name in problem.simulation.parameters
    }


def late_otherwise(problem: Problem, values: Mapping[str, float]) -> bool:
    """Return whether a late channel changes by more, or less, than at the problem's values: its size would be wrong."""
    here, there = problem.filled, problem.changed(**values)
    shown = as_shown(problem, [here, there])
    now, then = ((late - at)[problem.mask] for late, at in zip(shown, (here, there), strict=True))
    share = problem.thresholds.size_discrepancy_std
    return power(then - now) > share**2 * power(now)


def put_on_time_by(problem: Problem, late: Mapping[str, float], channel: tuple[str, float] | None) -> bool:
    """Return whether a problem has these inputs on time that are late by so much [s], and no others.

    None but those that the simulation was corrected by. Beside late inputs, the channel has to be as late as it was
    found to be, too: each delay is found beside the other.
    """
    within = ON_TIME_WITHIN * problem.recording.step_s
    if late and channel and problem.late:
        (kind, delay), (found, now) = problem.late, channel
        if kind != found or abs(now - delay) > within:
            return False
    if len(problem.on_time.keys() - late.keys()) > sum(effect.on_time for effect in problem.stated):
        return False
    return all(abs(delay - problem.on_time.get(name, 0.0)) <= within for name, delay in late.items())
