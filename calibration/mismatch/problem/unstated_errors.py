"""Errors of inputs that nobody stated, where the recording shows them: noise that the measured column does not follow.

An input with an error that is taken as exact makes a prediction noisy, biases the parameters towards a weaker response,
and lets a delay of half a reading, which is a mean of two, or any law of the same input seem to be there. How far the
readings scatter about what the readings beside them say is an error, or it is what the input did. The simulation
decides, which follows the measured column clearly worse with that scatter, or clearly better. Else nothing is assumed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.errors_in_variables import expected_inputs
from regolithd.calibration.mismatch.problem.prior import SensorError
from regolithd.calibration.mismatch.signal.first_order import FirstOrder
from regolithd.calibration.mismatch.signal.robust import robust_std

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]

CLEARLY = 5.0
"""Log likelihood ratio from which the scatter of an input is an error (a choice: e⁵ to one)."""
LEAST_SCATTER = 1e-3
"""Scatter in standard deviations of the input below which it does not matter (a choice)."""
OF_SECOND_DIFFERENCE = 6.0**-0.5
"""Standard deviation of white noise over that of its second differences."""


def unstated_errors(
    as_read: Recording, simulation: Predictor, predict: Callable[[Recording], Array], normal: Collection[str] = ()
) -> dict[str, SensorError]:
    """Return the errors of inputs without a stated one.

    `predict` runs the simulation at the stated values; `normal` as in `expected_inputs`. One run for each input that
    scatters, and one more.
    """
    scattering = {}
    for name in simulation.inputs:
        stated = simulation.sensors.get(name)
        if name in as_read.channels and name != simulation.channel and (stated is None or stated == SensorError()):
            deviation = scatter(as_read.channels[name], as_read.run)
            if deviation > LEAST_SCATTER * float(np.nanstd(as_read.channels[name])):
                scattering[name] = SensorError(absolute=deviation)
    found = {}
    before = predict(as_read) if scattering else np.zeros(0)
    for name, error in scattering.items():
        smooth = predict(expected_inputs(as_read, {name: error}, normal))
        left = as_read.channel(simulation.channel) - smooth
        noise = FirstOrder.of([left])
        if noise.log_likelihood_ratio(before - smooth, left) < -CLEARLY:
            found[name] = error
    return found


def scatter(values: Array, run: NDArray[np.int64]) -> float:
    """Return the standard deviation of white noise in readings (time, wheel), by second differences within a run.

    Their median does not see steps. 0 where more than half of them are 0: a column that is set, or rounded.
    """
    same = (run[2:] == run[:-2])[:, None]
    second = np.where(same, values[2:] - 2 * values[1:-1] + values[:-2], np.nan)
    return OF_SECOND_DIFFERENCE * robust_std(second[np.isfinite(second)])


def notes_on_unstated(errors: Mapping[str, SensorError], channel: str) -> tuple[str, ...]:
    """Return what is told of each error that was taken."""
    return tuple(
        f"{name} has no stated error. Its readings scatter by {error.absolute:.2g} (one standard deviation), which "
        f"{channel} does not follow: this is taken as their error. State it in [sensors]."
        for name, error in errors.items()
    )
