"""What an answer says of a decision: the verdict, each named effect, and what stays unexplained."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import CalibratedParameter, Effect, Parameter, Unexplained
from regolithd.calibration.mismatch.changes import ChangedSize, changes_of
from regolithd.calibration.mismatch.inference.evidence import calibrated_values, wheel_names
from regolithd.calibration.mismatch.inference.intervals import parameters_of
from regolithd.calibration.mismatch.regression.blocks import blocks_of_time
from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of
from regolithd.calibration.mismatch.report.statements import statement

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from regolithd.calibration.mismatch.answer import Change, Verdict
    from regolithd.calibration.mismatch.inference.held_out import HeldOutErrors
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.selection.decision import Decision
    from regolithd.calibration.mismatch.thresholds import Thresholds

NINETY_PERCENT_STDS = 1.645
"""Half the width of a 90 % interval of a normal density, in standard deviations."""
BEGINNING, END = 0.01, 0.99
"""Shares of a curve's power before and after which it counts as not there."""


def verdict_of(decision: Decision, moved: Sequence[CalibratedParameter]) -> Verdict:
    """Return the verdict: unexplained goes before named; `moved` are parameters that left their priors."""
    if decision.unnamed:
        return "unexplained"
    return "missing-physics" if decision.named.terms or moved else "consistent"


def noise_floor(decision: Decision) -> float:
    """Return the noise's root mean square over all readings."""
    counts = decision.equations.design.counts.sum(axis=0)
    return float(np.sqrt(np.sum(decision.noise.deviation**2 * counts) / counts.sum()))


def named_effects(decision: Decision, held_out: HeldOutErrors) -> tuple[tuple[Effect, ...], tuple[Change, ...]]:
    """Return the named effects with parameters and held-out errors, and what changed of corrected ones."""
    named, equations = decision.named, decision.equations
    if not named.terms:
        return (), ()
    parameters = parameters_of(equations, named, blocks_of_time(equations.problem, decision.noise))
    effects: list[Effect] = []
    changes: list[Change] = []
    for index, (term, of_term) in enumerate(zip(named.terms, parameters, strict=True)):
        if isinstance(term.group.candidate, ChangedSize):
            changes += changes_of(term.group.candidate, of_term)
        else:
            errors = held_out.without[index], held_out.with_it[index]
            effects.append(_effect(equations.problem, term, of_term, errors))
    return tuple(effects), tuple(changes)


def calibrated_parameters(decision: Decision) -> tuple[CalibratedParameter, ...]:
    """Return where the recording moved each parameter of the simulation, beside all that was found."""
    equations, fit = decision.equations, decision.whole
    problem, nuisance = equations.problem, equations.nuisance
    values = calibrated_values(equations, fit)
    places = {name: place for place, name in enumerate(nuisance.names)}
    found = []
    for name, prior in problem.simulation.parameters.items():
        std = 0.0
        if name in places:
            place = places[name]
            variance = fit.covariance[place, place]
            std = float(np.sqrt(max(variance, 0.0)) / equations.design.scale[nuisance.columns[place]])
        value = float(values[name])
        low, high = value - NINETY_PERCENT_STDS * std, value + NINETY_PERCENT_STDS * std
        found.append(CalibratedParameter(name, prior.unit, prior.value, prior.std, value, low, high))
    return tuple(found)


def beyond_prior(parameters: Iterable[CalibratedParameter], thresholds: Thresholds) -> tuple[CalibratedParameter, ...]:
    """Return the parameters that had to leave their priors: a finding, whatever else was found."""
    return tuple(
        each
        for each in parameters
        if each.prior_std > 0 and abs(each.value - each.prior) > thresholds.furthest_prior_stds * each.prior_std
    )


def _effect(problem: Problem, term: Term, parameters: Mapping[str, Parameter], errors: tuple[float, float]) -> Effect:
    candidate, simulation = term.group.candidate, problem.simulation
    assert candidate is not None  # noqa: S101  # named terms are candidates
    wheels = wheel_names(problem, term.wheels)
    onset = parameters.get(candidate.change_point)
    all_wheels = len(problem.recording.wheels)
    return Effect(
        name=term.name,
        channel=candidate.channel or simulation.channel,
        wheels=wheels,
        covariate=candidate.covariate,
        onset_s=None if onset is None else onset.value,
        equation=candidate.equation,
        statement=statement(candidate, wheels, all_wheels, parameters, errors, simulation.wheel_column),
        parameters=parameters,
        rmse_before=errors[0],
        rmse_after=errors[1],
    )


def unexplained(decision: Decision, term: Term) -> Unexplained:
    """Return where a smooth term acts, from when to when, and how much of the residual it is."""
    equations, problem = decision.equations, decision.equations.problem
    on = list(term.wheels)
    squares = contribution(equations, decision.whole, decision.whole.terms.index(term))[:, on] ** 2
    before = residual_of(equations, equations.fit(()))[:, on] ** 2
    power = np.sum(squares, axis=1)
    grown = np.cumsum(power) / max(float(power.sum()), 1e-300)
    time_s = problem.time_s[:, 0]
    first, last = (time_s[min(int(np.searchsorted(grown, part)), len(time_s) - 1)] for part in (BEGINNING, END))
    return Unexplained(
        channel=problem.simulation.channel,
        wheels=wheel_names(problem, term.wheels),
        covariate=term.name,
        from_s=float(first),
        to_s=float(last),
        share_of_residual=min(float(np.sum(squares) / max(float(np.sum(before)), 1e-300)), 1.0),
    )
