"""How much the stated errors of its inputs change a prediction, reading by reading.

Where a prediction is steep in an input, near standstill in a slip that is a quotient of two speeds, a small error of
that input is a large one of the prediction. Such a reading says less than another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.errors_in_variables import known_mean
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.problem.reading_scale import ReadingScale

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]

LEAST_LEFT = 0.02
"""Share of an error's variance that smoothing leaves at least (a choice: a mean of fifty readings)."""


@dataclass(frozen=True, eq=False)
class InputDoubt:
    """The variance of a prediction by what is uncertain of its inputs, shape (time, wheel) each.

    Attributes
    ----------
    alone: of each reading
    together: by which a mean over wheels and time is as uncertain as if each reading had this for itself: an error that
        wheels have in common does not average out, and smoothing an input leaves the slow part of its error as it was
    """

    alone: Array
    together: Array


def input_doubt(
    as_read: Recording, expected: Recording, simulation: Predictor, values: Mapping[str, float]
) -> InputDoubt | None:
    """Return how uncertain the prediction from expected inputs is by the stated errors of their readings.

    One run of the simulation for each input with an error: at each instant one standard deviation up or down, by lot,
    since a simulation that integrates would add up an error that stays. None where no input has an error.
    """
    inputs = complete_inputs(expected)
    scales = {
        name: ReadingScale.of(as_read.channels[name], error)
        for name, error in simulation.sensors.items()
        if name in as_read.channels and name in inputs
    }
    stated = {name: scale.error(inputs[name]) for name, scale in scales.items() if scale.deviation > 0}
    if not stated:
        return None
    before = simulation.predict(inputs, values)
    alone, together, random = np.zeros(before.shape), np.zeros(before.shape), np.random.default_rng(0)
    for name, error in stated.items():
        lot = error * random.choice([-1.0, 1.0], size=(len(before), 1))
        variance = np.nan_to_num(simulation.predict({**inputs, name: inputs[name] + lot}, values) - before) ** 2
        alone += variance * _left_by_smoothing(as_read.channels[name] - inputs[name], error)
        together += variance * wheels_in_common(inputs[name])
    return InputDoubt(alone, together)


def total_doubt(doubts: Iterable[InputDoubt | None]) -> InputDoubt | None:
    """Return the sum of what independent causes make uncertain; None: nothing does."""
    known = [doubt for doubt in doubts if doubt is not None]
    if not known:
        return None
    alone, together = (np.sum([getattr(doubt, name) for doubt in known], axis=0) for name in ("alone", "together"))
    return InputDoubt(alone, together)


def _left_by_smoothing(taken_out: Array, error: Array) -> float:
    """Return the share of an error's variance that is left in its conditional expectation.

    What smoothing takes out is a function of the readings, and what is left of the error is orthogonal to these.
    """
    return float(np.clip(1 - known_mean((taken_out / error).ravel() ** 2), LEAST_LEFT, 1.0))


def wheels_in_common(values: Array) -> int:
    """Return how many wheels have one sensor: all, where its readings (time, wheel) are the same on each."""
    return (
        values.shape[1] if np.array_equal(values, np.broadcast_to(values[:, :1], values.shape), equal_nan=True) else 1
    )
