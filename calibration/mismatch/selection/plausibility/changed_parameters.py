"""A fault of one wheel against a parameter of the simulation that changes at the same time.

A clogged outlet raises one level as a drifting load cell would, but it acts as the outlet's area does, on the next
tank too. The library has no name for a parameter that changes; so the fault loses its name, and what changes with time
stays unexplained.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.candidates.growth import growth
from regolithd.calibration.mismatch.candidates.late_columns import columns_of
from regolithd.calibration.mismatch.selection.shape_optimisation import shape_profile

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

SAME_ACTION = 0.99
"""Cosine of two courses above which they are one action (a choice: a fiftieth of the power differs)."""


class _ChangedParameter(Candidate):
    """A parameter that moves away from its value after an onset."""

    coefficients: ClassVar = (Coefficient("change", "1", 0),)

    def __init__(self, parameter: str) -> None:
        self._parameter = parameter

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return ∂prediction/∂parameter times the growth since the onset."""
        return (problem.tangent(self._parameter) * growth(problem, shape))[None]


def drop_what_a_changed_parameter_explains(equations: NormalEquations, named: Fit) -> Fit:
    """Leave out faults of one wheel that begin at some time, where a parameter that changes then is ahead.

    Both have one coefficient and the same course over time. A lead of `lead_margin` against a true fault is chance in
    2 % of the cases at most: where the wrong one lags by d² on average, with the variance 4 d², it leads by L with
    the probability Φ(−(d² + L)/2d), which is Φ(−√L) at most. No law is exact to the last percent: of a large fault the
    lead must be that share (`further_share`) more.
    """
    kept = [term for index, term in enumerate(named.terms) if not _is_changed_parameter(equations, named, index, term)]
    return named if len(kept) == len(named.terms) else equations.fit(kept)


def _is_changed_parameter(equations: NormalEquations, named: Fit, index: int, term: Term) -> bool:
    candidate = term.group.candidate
    if candidate is None or tuple(candidate.sharing) != ("one",) or candidate.change_point not in term.group.shape:
        return False
    if term.group.is_change:  # its onset is the corrected effect's: it has none of its own
        return False
    others, shape = named.without(index), term.group.shape
    gain = named.delta_chi2 - equations.fit(others).delta_chi2
    beside = shape_profile(equations, others, candidate, equations.all_wheels)
    parameters = equations.problem.simulation.parameters
    changes = [_ChangedParameter(name) for name, prior in parameters.items() if prior.told and prior.std > 0]
    rivals = [change for change in changes if not _is_the_effect(equations.problem, change, term)]
    limits = equations.thresholds
    least = gain + limits.lead_margin + limits.further_share * gain
    return any(replace(beside, candidate=change)(shape) > least for change in rivals)


def _is_the_effect(problem: Problem, change: _ChangedParameter, term: Term) -> bool:
    """Return whether a change of a parameter acts as the effect does: a no-load current that rises is a drag."""
    assert term.group.candidate is not None  # noqa: S101  # only named terms come here
    shape, elsewhere = term.group.shape, [k for k in range(problem.mask.shape[1]) if k not in term.wheels]
    changed = np.where(problem.mask, change.columns(problem, shape)[0], 0.0)
    effect = np.where(problem.mask, columns_of(problem, term.group.candidate, shape)[0], 0.0)
    effect[:, elsewhere] = 0.0
    return same_action(changed, effect)


def same_action(one: Array, other: Array) -> bool:
    """Return whether two courses (time, wheel) are one action, of either sign."""
    along = float(np.sum(one * other))
    return abs(along) > SAME_ACTION * float(np.linalg.norm(one) * np.linalg.norm(other))
