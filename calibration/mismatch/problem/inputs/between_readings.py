"""How uncertain a prediction is by what its inputs were between their readings.

A column that is read less often than the rows is filled in between. One that is late is put on time: by a delay that is
no whole number of readings, each of its values is one between two readings. Where a column steps, that is far off.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.slow_channels import drawn_between, filled_between, off_line
from regolithd.calibration.mismatch.problem.inputs.input_doubt import InputDoubt, wheels_in_common
from regolithd.calibration.mismatch.problem.predictor import complete_inputs

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BetweenReadings:
    """What a slower column makes uncertain of the prediction: all of it, and its size since the column was read."""

    doubt: InputDoubt
    within: Array


def doubt_by_slower(
    recording: Recording, simulation: Predictor, predict: Callable[[Recording], Array], predicted: Callable[[], Array]
) -> dict[str, BetweenReadings]:
    """Return how uncertain the prediction is by each slower column that it depends on, between its readings.

    `predict` runs the simulation on a recording whose slower columns are filled in, `predicted` returns the prediction
    from the readings as they are.
    """
    filled = filled_between(recording, simulation.channel, simulation.between_readings)
    found = {}
    for name, column in filled.channels.items():
        if column is recording.channels[name]:
            continue
        drawn, last = drawn_between(recording, filled, name, simulation.between_readings.get(name, "linear"))
        off = np.nan_to_num(predict(filled.with_channels(**{name: drawn})) - predicted())
        if off.any():
            rows = np.stack([np.bincount(of_wheel)[of_wheel] for of_wheel in last.T], axis=1)
            within = np.abs(off - np.take_along_axis(off, last, axis=0))
            found[name] = BetweenReadings(_doubt(off, off**2 * rows * wheels_in_common(drawn)), within)
    return found


def doubts_by_moved(
    moved: Recording,
    predict: Callable[[Mapping[str, Array]], Array],
    predicted: Array,
    late: Mapping[str, float],
    on: Mapping[str, Sequence[int]],
) -> list[InputDoubt]:
    """Return how uncertain a prediction is by each input that was put on time by so much [s], on these wheels.

    `predict` runs the simulation on other inputs, once for each, and `predicted` is what it says of these.
    """
    inputs, found = complete_inputs(moved), []
    for name, delay in late.items():
        off = _drawn_off(inputs[name], (delay / moved.step_s) % 1.0, on.get(name, ()))
        if off.any():
            changed = np.nan_to_num(predict({**inputs, name: inputs[name] + off}) - predicted)
            found.append(_doubt(changed, changed**2 * wheels_in_common(inputs[name])))
    return found


def _drawn_off(values: Array, share: float, on: Sequence[int]) -> Array:
    """Return how far a column (time, wheel), each value at this share of a step, may be off, up or down by lot."""
    random, found = np.random.default_rng(0), np.zeros(values.shape)
    lot = random.choice([-1.0, 1.0], size=(len(values), 1)) * np.ones(values.shape)
    for k, column in enumerate(values.T):
        if not on or k in on:
            found[:, k] = np.append(off_line(column, share), 0.0)
    return np.nan_to_num(lot * found)


def _doubt(off: Array, together: Array) -> InputDoubt:
    return InputDoubt(off**2, together, np.zeros(off.shape), np.zeros((0, *off.shape)))
