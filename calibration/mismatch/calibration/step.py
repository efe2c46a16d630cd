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
        """Return the prediction at the end, shape (compared reading,); NaN where the simulation refuses the values."""
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

    def is_bent(self) -> bool:
        """Return whether the prediction differs from its tangents by more than the noise lets pass."""
        problem = self.problem
        shifts = {name: at - problem.values[name] for name, at in self.values.items() if at != problem.values[name]}
        if not shifts:
            return False
        along = problem.filled + sum(shift * problem.tangent(name) for name, shift in shifts.items())
        apart = self.run - along[problem.mask]
        return self.is_defined and power(apart) > problem.thresholds.linearisation_share**2 * power(
            self.measured - self.run
        )

    def leads_to_another_law(self) -> bool:
        """Return whether what is a share of the prediction, such as a loss, would have another law at the end.

        That is where the prediction changes by more than may be missed of a law.
        """
        share = self.problem.thresholds.form_misfit
        return self.is_defined and power(self.run - self.begin) > share * power(self.run)

    def damped(self) -> Mapping[str, float]:
        """Return the values at the end, the step halved until the simulation fits the recording no worse than before.

        Tangents at a value of 0, where a part of the simulation does nothing, may lead anywhere.
        """
        step, most = self, WORSE * power(self.measured - self.begin)
        for _ in range(HALVINGS):
            if step.is_defined and power(self.measured - step.run) <= most:
                break
            step = replace(
                step, values={name: (self.problem.values[name] + at) / 2 for name, at in step.values.items()}
            )
        return step.values


def power(values: Array) -> float:
    """Return the mean square."""
    return float(np.mean(values**2))
