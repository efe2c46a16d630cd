"""How much the stated errors of its inputs change a prediction, reading by reading.

Where a prediction is steep in an input, near standstill in a slip that is a quotient of two speeds, a small error of
that input is a large one of the prediction. Such a reading says less than another. Where a prediction is curved in an
input, the prediction from the expected input is not the expected prediction: the mean of a squared current is more than
the square of its mean, by the variance that is left (Jensen's inequality).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.errors_in_variables import at_rest, known_mean, run_starts
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.problem.reading_scale import ReadingScale
from regolithd.calibration.mismatch.problem.true_values import direction_beside_rest

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor
    from regolithd.calibration.mismatch.problem.prior import SensorError

Array = NDArray[np.float64]

DRAWS = 8
"""Draws of errors that last (a choice: of a variance from so many the standard deviation is known to a quarter)."""
LASTING = 0.5
"""Correlation of the prediction's error with that of the next reading, from which it lasts (a choice: errors of
readings are independent, and what a prediction makes of each alone has none)."""
KEPT_IN_MOTION = 0.5
"""Share of a value by which it is uncertain at most where its direction is known (a choice: any below 1)."""
LEAST_LEFT = 0.02
"""Share of an error's variance that smoothing leaves at least (a choice: a mean of fifty readings)."""


SUMMED = ("alone", "together", "bias")
"""What independent causes add up to."""


@dataclass(frozen=True, eq=False)
class InputDoubt:
    """What the inputs' errors do to a prediction, shape (time, wheel) each.

    Attributes
    ----------
    alone: the variance of each reading's
    together: by which a mean over wheels and time is as uncertain as if each reading had this for itself: an error that
        wheels have in common does not average out, and smoothing an input leaves the slow part of its error as it was
    bias: the expected prediction less that from the expected inputs
    draws: of its error, where that lasts from one reading to the next, shape (draw, time, wheel); else there are none
    """

    alone: Array
    together: Array
    bias: Array
    draws: Array


def input_doubt(
    as_read: Recording,
    expected: Recording,
    simulation: Predictor,
    values: Mapping[str, float],
    errors: Mapping[str, SensorError],
) -> InputDoubt | None:
    """Return how uncertain the prediction from expected inputs is by the errors of their readings.

    Two runs of the simulation for each input with an error: at each instant one standard deviation of what smoothing
    leaves up or down, by lot, since a simulation that integrates would add up an error that stays, and the other way
    round. Of one that integrates the error lasts: it is drawn `DRAWS` times more, whole, with all inputs at once. None
    where no input has an error.
    """
    inputs = complete_inputs(expected)
    scales = {
        name: ReadingScale.of(as_read.channels[name], error)
        for name, error in errors.items()
        if name in as_read.channels and name in inputs
    }
    # What is at rest is known to be (`errors_in_variables.py`): a simulation may have a step beside it.
    starts = run_starts(as_read)
    stated = {name: _in_motion(inputs[name], scale, starts) for name, scale in scales.items() if scale.deviation > 0}
    if not stated:
        return None
    before = simulation.predict(inputs, values)
    alone, together, bias = (np.zeros(before.shape) for _ in range(3))
    random, lasting = np.random.default_rng(0), False
    for name, error in stated.items():
        left = _left_by_smoothing(as_read.channels[name] - inputs[name], error)
        # By what is left, not by a share of what the whole error would do: a step of the prediction is further away.
        lot = np.sqrt(left) * error * random.choice([-1.0, 1.0], size=(len(before), 1))
        moved = (simulation.predict({**inputs, name: inputs[name] + sign * lot}, values) for sign in (1.0, -1.0))
        one, other = (np.nan_to_num(each - before) for each in moved)
        alone += (one**2 + other**2) / 2
        together += wheels_in_common(inputs[name]) * (one**2 + other**2) / (2 * left)
        bias += (one + other) / 2
        lasting |= _lasts(one - other)
    draws = np.zeros((DRAWS if lasting else 0, *before.shape))
    for place in range(len(draws)):
        lots = {name: error * random.choice([-1.0, 1.0], size=(len(before), 1)) for name, error in stated.items()}
        drawn = {**inputs, **{name: inputs[name] + lot for name, lot in lots.items()}}
        draws[place] = np.nan_to_num(simulation.predict(drawn, values) - before)
    return InputDoubt(alone, together, bias, draws)


def _in_motion(values: Array, scale: ReadingScale, starts: NDArray[np.int64]) -> Array:
    """Return the standard deviation of an input's error (time, wheel): 0 at rest, and without a change of sign beside.

    Where a motion begins at a rest or ends there, its direction is known (`true_values.direction_beside_rest`).
    """
    error, rest = np.where(values == 0, 0.0, scale.error(values)), at_rest(values, starts)
    for k in np.flatnonzero(rest.any(axis=0)):
        beside = direction_beside_rest(values[:, k], scale.absolute, rest[:, k]) != 0
        error[beside, k] = np.minimum(error[beside, k], KEPT_IN_MOTION * np.abs(values[beside, k]))
    return error


def _lasts(error: Array) -> bool:
    """Return whether a prediction's error (time, wheel) goes on from one reading to the next."""
    power = float(np.sum(error[:-1] ** 2))
    return float(np.sum(error[1:] * error[:-1])) > LASTING * power > 0


def bias_of(doubt: InputDoubt | None) -> Array | float:
    """Return what the inputs' errors add to the mean of a prediction; nothing where none is known."""
    return 0.0 if doubt is None else doubt.bias


def total_doubt(doubts: Iterable[InputDoubt | None]) -> InputDoubt | None:
    """Return the sum of what independent causes make uncertain; None: nothing does."""
    known = [doubt for doubt in doubts if doubt is not None]
    if not known:
        return None
    alone, together, bias = (np.sum([getattr(each, name) for each in known], axis=0) for name in SUMMED)
    return InputDoubt(alone, together, bias, np.concatenate([each.draws for each in known]))


def _left_by_smoothing(taken_out: Array, error: Array) -> float:
    """Return the share of an error's variance that is left in its conditional expectation.

    What smoothing takes out is a function of the readings, and what is left of the error is orthogonal to these.
    """
    uncertain = error > 0
    return float(np.clip(1 - known_mean((taken_out[uncertain] / error[uncertain]) ** 2), LEAST_LEFT, 1.0))


def wheels_in_common(values: Array) -> int:
    """Return how many wheels have one sensor: all, where its readings (time, wheel) are the same on each."""
    return (
        values.shape[1] if np.array_equal(values, np.broadcast_to(values[:, :1], values.shape), equal_nan=True) else 1
    )
