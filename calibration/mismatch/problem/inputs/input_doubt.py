"""How much the stated errors of its inputs change a prediction, reading by reading.

Where a prediction is steep in an input, near standstill in a slip that is a quotient of two speeds, a small error of
that input is a large one of the prediction. Such a reading says less than another. Where a prediction is curved in an
input, the prediction from the expected input is not the expected prediction: the mean of a squared current is more than
the square of its mean, by the variance that is left (Jensen's inequality).

What smoothing leaves of an error is slow. A simulation that differentiates an input makes of it what independent errors
would not show: there the smoothed input is read and smoothed again, and what comes out is what the error may be
(parametric bootstrap; Efron and Tibshirani, 1993). And where an input is within its error of 0, its sign is not known:
a simulation that reverses friction with it may be wrong by twice the friction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import at_rest, known_mean, run_starts
from regolithd.calibration.mismatch.problem.inputs.reading_scale import ReadingScale
from regolithd.calibration.mismatch.problem.inputs.true_values import direction_beside_rest
from regolithd.calibration.mismatch.problem.inputs.unknown_directions import UnknownDirections
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.signal.intermittency.means import local_means

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.inputs.true_values import Smoother
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
DIFFERENTIATED = -0.2
"""Correlation of the prediction's error with that of one of `FURTHEST` readings later, at which the simulation
differentiates an input whose errors are independent (a choice: a central difference has -0.5, chance -0.1)."""
FURTHEST = 16
"""Readings over which a simulation differentiates at most (a choice)."""
AVERAGED = 15
"""Readings over which such errors, and their squares, are averaged (a choice: a few times as long as they last)."""
MOST_OF_DRAWN = 4.0
"""Times as much as drawn that their variance may be (a choice: where the truth changes most, a smoother that suits the
whole recording leaves up to twice the error)."""
MOST_DRAWN = 1.5
"""Deviations of a reading's error beyond which smoothing leaves nothing (a choice: it leaves half of one)."""

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
    most: times as large as told that the variances may be
    """

    alone: Array
    together: Array
    bias: Array
    draws: Array
    most: float = 1.0

    @property
    def of_derivative(self) -> bool:
        """Whether the simulation differentiates an input that has errors."""
        return self.most > 1


def input_doubt(
    as_read: Recording,
    expected: Recording,
    simulation: Predictor,
    values: Mapping[str, float],
    errors: Mapping[str, SensorError],
    smoothers: Mapping[str, Sequence[Smoother]] | None = None,
) -> InputDoubt | None:
    """Return how uncertain the prediction from expected inputs is by the errors of their readings.

    `smoothers` are how inputs were smoothed on each wheel (`errors_in_variables.py`).

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
    asked = _Asked(simulation, inputs, values)
    random, doubts, lasting = np.random.default_rng(0), [], False
    for name, error in stated.items():
        left = _left_by_smoothing(as_read.channels[name] - inputs[name], error)
        # By what is left, not by a share of what the whole error would do: a step of the prediction is further away.
        lot = np.sqrt(left) * error * random.choice([-1.0, 1.0], size=(len(error), 1))
        one, other = (asked.change(name, inputs[name] + sign * lot) for sign in (1.0, -1.0))
        in_common = wheels_in_common(inputs[name])
        if smoothers and name in smoothers and _differentiated(one - other):
            drawn = asked.variance(name, _drawn(inputs[name], error, smoothers[name]))
            variance = np.maximum(local_means(drawn, drawn > 0, starts, AVERAGED), 0.0)
            doubts.append(InputDoubt(variance, in_common * variance, (one + other) / 2, asked.none, MOST_OF_DRAWN))
        else:
            variance = (one**2 + other**2) / 2
            doubts.append(InputDoubt(variance, in_common * variance / left, (one + other) / 2, asked.none))
            lasting |= _lasts(one - other)
        unknown = UnknownDirections.of(inputs[name], as_read.channels[name], scales[name], sqrt(left), starts)
        if unknown.probability.any():
            one, other = (asked.change(name, each) for each in unknown.ways)
            variance = unknown.probability * (one - other) ** 2
            together = in_common * unknown.readings * variance
            doubts.append(InputDoubt(variance, together, np.zeros_like(variance), asked.none))
    draws = np.zeros((DRAWS if lasting else 0, *asked.before.shape))
    for place in range(len(draws)):
        lots = {name: error * random.choice([-1.0, 1.0], size=(len(error), 1)) for name, error in stated.items()}
        draws[place] = asked.changed({name: inputs[name] + lot for name, lot in lots.items()})
    total = total_doubt(doubts)
    return None if total is None else replace(total, draws=draws)


class _Asked:
    """A simulation at some inputs, and what it predicts from others less that, shape (time, wheel)."""

    def __init__(self, simulation: Predictor, inputs: Mapping[str, Array], values: Mapping[str, float]) -> None:
        self._simulation, self._inputs, self._values = simulation, inputs, values
        self.before = simulation.predict(inputs, values)
        self.none = np.zeros((0, *self.before.shape))

    def changed(self, others: Mapping[str, Array]) -> Array:
        """Return the change with some inputs as these."""
        return np.nan_to_num(self._simulation.predict({**self._inputs, **others}, self._values) - self.before)

    def change(self, name: str, other: Array) -> Array:
        """Return the change with one input as this."""
        return self.changed({name: other})

    def variance(self, name: str, others: Iterable[Array]) -> Array:
        """Return the mean square of the changes with one input as each of these."""
        squares = [self.change(name, other) ** 2 for other in others]
        return np.asarray(np.mean(squares, axis=0))


def _differentiated(error: Array) -> bool:
    """Return whether a prediction's error (time, wheel) by independent errors of an input is that of a derivative."""
    power = float(np.sum(error**2))
    lags = range(1, min(FURTHEST, len(error) - 1) + 1)
    return any(float(np.sum(error[lag:] * error[:-lag])) < DIFFERENTIATED * power for lag in lags)


def _drawn(values: Array, error: Array, smoothers: Sequence[Smoother]) -> Iterator[Array]:
    """Yield inputs (time, wheel) as they may be, `DRAWS` times: read again with errors, and smoothed again."""
    random = np.random.default_rng(1)
    wheels = values.shape[1] // wheels_in_common(values)
    for _ in range(DRAWS):
        read = values + error * random.normal(size=(len(values), wheels))
        again = np.stack([smooth(column) for smooth, column in zip(smoothers, read.T, strict=True)], axis=1)
        yield values + np.clip(np.nan_to_num(again - values), -MOST_DRAWN * error, MOST_DRAWN * error)


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
    draws = np.concatenate([each.draws for each in known])
    return InputDoubt(alone, together, bias, draws, max(each.most for each in known))


def _left_by_smoothing(taken_out: Array, error: Array) -> float:
    """Return the share of an error's variance that is left in its conditional expectation.

    What smoothing takes out is a function of the readings, and what is left of the error is orthogonal to these.
    """
    uncertain = error > 0
    return float(np.clip(1 - known_mean((taken_out[uncertain] / error[uncertain]) ** 2), LEAST_LEFT, 1.0))


def without_error_of_derivatives(prediction: Array, doubt: InputDoubt | None, recording: Recording) -> Array:
    """Return a prediction (time, wheel) as a covariate: its means, where it has the error of a differentiated input.

    A curve over the prediction itself would follow the error. It swings about 0, and means have hardly any of it.
    """
    if doubt is None or not doubt.of_derivative:
        return prediction
    moving = np.isfinite(prediction) & (prediction != 0)
    return local_means(prediction, moving, run_starts(recording), AVERAGED)


def wheels_in_common(values: Array) -> int:
    """Return how many wheels have one sensor: all, where its readings (time, wheel) are the same on each."""
    return (
        values.shape[1] if np.array_equal(values, np.broadcast_to(values[:, :1], values.shape), equal_nan=True) else 1
    )
