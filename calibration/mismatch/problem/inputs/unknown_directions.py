"""Where a noisy input may have the other sign: within its error of 0, and at the ends of what seems to rest.

A simulation that takes the sign of a speed for the direction of friction is wrong there by twice the friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import at_rest
from regolithd.calibration.mismatch.problem.inputs.true_values import FEWEST_AT_REST, direction_beside_rest
from regolithd.calibration.mismatch.signal.intermittency.stretches import stretches

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.inputs.reading_scale import ReadingScale

Array = NDArray[np.float64]

ONE_SIDED = 2.0
"""Factor from the usual deviation of a smoothed value to that where it has readings on one side alone (a choice: of a
spline's variance, four to nine times as much)."""
LEAST_WRONG = 0.001
"""Probability of the other sign below which it is known (a choice)."""
BESIDE_ZERO = 0.01
"""Deviations of an error from 0 at which the prediction is asked for its step (a choice: nothing else changes)."""
LONGEST_START = 10
"""Readings from a rest to a clear motion at most that surely have its direction (a choice: a motion that takes longer
may have crept the other way first)."""
AT_AN_EDGE = 2
"""Readings at the ends of what seems to rest that may be in motion already, or still (a choice: a start or a stop
within the error of 0 takes about as many)."""


@dataclass(frozen=True, eq=False)
class UnknownDirections:
    """Where the direction of an input is not known, shape (time, wheel) each.

    Attributes
    ----------
    probability: that it is the other one, or that it moves where it seems to rest
    readings: how many one after the other have it wrong together
    ways: the input just beside 0, in the one and in the other of what is possible there
    """

    probability: Array
    readings: Array
    ways: tuple[Array, Array]

    @classmethod
    def of(cls, values: Array, read: Array, scale: ReadingScale, left: float, starts: NDArray[np.int64]) -> Self:
        """Return those of an input by its expected values and its readings.

        A direction is known at rest, and by the motion beside a rest. `left` is the share of an error's deviation that
        smoothing leaves.
        """
        from scipy.special import ndtr  # noqa: PLC0415  # reading a recording must not load SciPy

        deviation = max(min(ONE_SIDED * left, 1.0) * scale.absolute, np.finfo(float).tiny)
        wrong = np.where(values == 0, 0.0, ndtr(-np.abs(np.nan_to_num(values, nan=np.inf)) / deviation))
        rest, readings, moving = at_rest(read, starts), np.zeros(values.shape), np.zeros(values.shape)
        for k, column in enumerate(values.T):
            known = rest[:, k] | (direction_beside_rest(column, scale.absolute, rest[:, k], LONGEST_START) != 0)
            wrong[known | (wrong[:, k] < LEAST_WRONG), k] = 0.0
            for first, end in stretches(wrong[:, k] > 0):
                readings[first:end, k] = min(end - first, FEWEST_AT_REST)
            moving[:, k] = _motion_at_ends(column, (column == 0) & ~rest[:, k])
        edges, step = moving != 0, BESIDE_ZERO * scale.absolute
        one = np.where(wrong > 0, step, np.where(edges, step * moving, values))
        other = np.where(wrong > 0, -step, values)
        return cls(np.where(edges, 0.5, wrong), np.where(edges, AT_AN_EDGE, readings), (one, other))


def _motion_at_ends(column: Array, still: NDArray[np.bool_]) -> Array:
    """Return the direction of the motion beside the first and last readings of what is still (time,); 0 elsewhere."""
    found = np.zeros(len(column))
    for first, end in stretches(still):
        if end - first > 2 * AT_AN_EDGE:
            found[first : first + AT_AN_EDGE] = np.sign(column[first - 1]) if first else 0.0
            found[end - AT_AN_EDGE : end] = np.sign(column[end]) if end < len(column) else 0.0
    return found
