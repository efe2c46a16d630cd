"""A step of the parameters: how far the tangents of the prediction may be followed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

HALVINGS = 5
"""Halvings of a step at most (a choice: a thirtieth of the way is left)."""
GAINED = 0.25
"""Share of the promised gain from which a step has not gone too far (the usual choice for trust regions)."""
WORSE = 1.1
"""Power of the residual, over the promised one, up to which a step has not gone too far (a choice)."""


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the parameters from where a problem is linearised. The simulation runs once at its end.

    Attributes
    ----------
    problem: where it is linearised
    values: the parameters' at the end of the step
    beside: what is added to the prediction at the end, shape (compared reading,), or nothing
    """

    problem: Problem
    values: Mapping[str, float]
    beside: Array | float = 0.0

    @property
    def shifts(self) -> dict[str, float]:
        """Return by how much each parameter that moves does."""
        before = self.problem.values
        return {name: at - before[name] for name, at in self.values.items() if at != before[name]}

    @cached_property
    def run(self) -> Array:
        """Return the prediction at the end, shape (compared reading,); NaN where the simulation refuses the values."""
        if not self.shifts:
            return self.begin
        try:
            return self.problem.changed(**self.values)[self.problem.mask]
        except SimulationError:
            return np.full(self.begin.shape, np.nan)

    @property
    def begin(self) -> Array:
        """Return the prediction at the beginning, shape (compared reading,)."""
        return self.problem.filled[self.problem.mask]

    @property
    def measured(self) -> Array:
        """Return the readings, shape (compared reading,)."""
        return self.problem.measured[self.problem.mask]

    @property
    def is_defined(self) -> bool:
        """Return whether the simulation predicts every reading at the end."""
        return bool(np.isfinite(self.run).all())

    @cached_property
    def along(self) -> Array:
        """Return what the tangents predict at the end, shape (compared reading,)."""
        problem = self.problem
        moved = sum((shift * problem.tangent(name) for name, shift in self.shifts.items()), problem.filled)
        return np.asarray(moved[problem.mask])

    def is_bent(self) -> bool:
        """Return whether the prediction differs from its tangents by more than the noise lets pass.

        Noise is what is left beside all that is added: what is left out would hide that tangents do not hold.
        """
        share, left = self.problem.thresholds.linearisation_share, self.measured - self.run - self.beside
        return self.is_defined and power(self.run - self.along) > share**2 * power(left)

    def leads_to_another_law(self) -> bool:
        """Return whether what is a share of the prediction, such as a loss, would have another law at the end.

        That is where the prediction changes by more than may be missed of a law.
        """
        share = self.problem.thresholds.form_misfit
        return self.is_defined and power(self.run - self.begin) > share * power(self.run)

    def holds(self) -> bool:
        """Return whether the simulation, with what is added beside it, fits about as its tangents promise.

        It has to gain a quarter of what they promise (Moré's rule for a trust region), or to fit as well as they do:
        firm priors may lead back by a little.
        """
        if not self.is_defined:
            return False
        before, left, promised = (
            power(self.measured - each) for each in (self.begin, self.run + self.beside, self.along + self.beside)
        )
        return left <= max(before - GAINED * (before - promised), WORSE * promised)

    def damped(self) -> Mapping[str, float]:
        """Return the values at the end, the step halved until it holds.

        Tangents at a value of 0, where a part of the simulation does nothing, may lead anywhere, and so may those of
        parameters that a curve can stand for.
        """
        step = self
        for _ in range(HALVINGS):
            if step.holds():
                break
            halfway = {name: (self.problem.values[name] + at) / 2 for name, at in step.values.items()}
            step = replace(step, values=halfway, beside=step.beside / 2)
        return step.values


def power(values: Array) -> float:
    """Return the mean square."""
    return float(np.mean(values**2))
