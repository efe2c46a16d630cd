"""Errors of inputs that nobody stated, or stated wrongly, where the recording shows them.

An input with an error that is taken as exact makes a prediction noisy, biases the parameters towards a weaker response,
and lets a delay of half a reading, which is a mean of two, or any law of the same input seem to be there. How far the
readings scatter about what the readings beside them say is an error, or it is what the input did. The simulation
decides: the measured column follows its prediction clearly better with inputs smoothed for that error than for the
stated one, or clearly worse. Else what is stated holds.

Only quick changes decide, and each prediction as late or early as it fits best: a smoothed input has another mean,
which may make up for physics that is missing, and where a column is late any smoothing brings the prediction nearer to
it.
"""

from __future__ import annotations

from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import at_rest, expected_inputs
from regolithd.calibration.mismatch.problem.inputs.reading_scale import ReadingScale
from regolithd.calibration.mismatch.problem.prior import SensorError
from regolithd.calibration.mismatch.signal.noise_models.first_order import FirstOrder
from regolithd.calibration.mismatch.signal.robust import robust_std
from regolithd.calibration.mismatch.signal.truths.smoothing_spline import fitted_rows
from regolithd.calibration.mismatch.signal.truths.wiener_filter import even_pieces, noise_floor

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]

EXACT = SensorError()
"""The error of an input that has none."""
CLEARLY = 5.0
"""Log likelihood ratio from which the scatter of an input is its error (a choice: e⁵ to one)."""
LEAST_SCATTER = 1e-3
"""Scatter in standard deviations of the input below which it does not matter (a choice)."""
HALF_WINDOW = 15
"""Readings on either side of an instant over whose mean a change is quick (a choice: parameters and physics that are
missing act more slowly, and noise of a few readings is told apart from it)."""
FURTHEST_SHARE = 0.1
"""How late or early a column may be, as a share of the recording (a choice: as long as a delay that is looked for)."""
NEAR = 1.4
"""Factor between scatter and stated error up to which the statement is asked no further (a choice: the variance is
twice as large)."""
ORDERS = (2, 3, 4, 5)
"""Orders of the differences that tell the scatter (a choice: of the higher ones little of a smooth course is left)."""


def shown_errors(
    as_read: Recording,
    simulation: Predictor,
    predict: Callable[[Recording], Array],
    expect: Callable[[], Recording],
    normal: Collection[str] = (),
) -> dict[str, SensorError]:
    """Return the errors of inputs whose readings scatter otherwise than stated, where they predict better with these.

    `predict` runs the simulation at the stated values, `expect` returns the recording with the inputs that are expected
    by the stated errors; `normal` as in `expected_inputs`. One run for each input that
    scatters otherwise, and one more. An input whose error is stated to be 0 is exact.
    """
    otherwise = {}
    for name in simulation.inputs:
        if name in as_read.channels and name != simulation.channel:
            stated_error = simulation.sensors.get(name)
            if stated_error == EXACT:
                continue
            error = _by_scatter(as_read.channels[name], as_read.time_s, as_read.run, stated_error or EXACT)
            if error is not None:
                otherwise[name] = error
    if not otherwise:
        return {}
    found, as_stated = {}, expect()
    stated = predict(as_stated)
    for name, error in otherwise.items():
        smooth = expected_inputs(as_read, {name: error}, normal).channels[name]
        try:
            prediction = predict(as_stated.with_channels(**{name: smooth}))
        except SimulationError:  # it accepts no other inputs than those recorded
            continue
        if _closer(as_read.channel(simulation.channel), prediction, stated, as_read.runs) > CLEARLY:
            found[name] = error
    return found


def _closer(measured: Array, one: Array, other: Array, runs: Sequence[slice]) -> float:
    """Return by how much the log likelihood of quick changes is larger with one prediction than with another.

    All are of shape (time, wheel), with NaN where nothing is known.
    """
    known = np.where(np.isfinite(one + other), measured, np.nan)
    target, *predictions = (_quick(np.where(np.isfinite(known), each, np.nan), runs) for each in (known, one, other))
    left = [_left_when_best_timed(target, each, runs) for each in predictions]
    both = np.isfinite(left[0] + left[1])
    of_one, of_other = (np.where(both, each, np.nan) for each in left)
    least = min((of_one, of_other), key=lambda each: float(np.nansum(each**2)))
    return -FirstOrder.of([least]).log_likelihood_ratio(of_one - of_other, of_one)


def _quick(values: Array, runs: Sequence[slice]) -> Array:
    """Return values (time, wheel) less their mean over a window about each instant, within each run."""
    found = np.full(values.shape, np.nan)
    for rows in runs:
        known, at = np.isfinite(values[rows]), np.arange(rows.stop - rows.start)
        first, end = np.maximum(at - HALF_WINDOW, 0), np.minimum(at + HALF_WINDOW + 1, len(at))
        summed = (np.cumsum(np.where(known, values[rows], 0.0), axis=0), np.cumsum(known, axis=0))
        total, count = (np.pad(each, ((1, 0), (0, 0)))[end] - np.pad(each, ((1, 0), (0, 0)))[first] for each in summed)
        found[rows] = values[rows] - total / np.maximum(count, 1)
    return found


def _left_when_best_timed(target: Array, prediction: Array, runs: Sequence[slice]) -> Array:
    """Return what a prediction leaves of a target, both (time, wheel), as late or early as leaves the least."""
    squares = np.zeros(2 * int(FURTHEST_SHARE * len(target)) + 1)
    counts = np.zeros(squares.shape)
    for rows in runs:
        one, other = target[rows], prediction[rows]
        seen, said = (np.isfinite(each).astype(np.float64) for each in (one, other))
        one, other = np.nan_to_num(one), np.nan_to_num(other)
        counts += _correlations(seen, said, len(counts))
        squares += _correlations(one**2, said, len(counts)) + _correlations(seen, other**2, len(counts))
        squares -= 2 * _correlations(one, other, len(counts))
    enough = counts > counts.max() / 2
    lag = int(np.argmin(np.where(enough, squares / np.maximum(counts, 1.0), np.inf))) - len(counts) // 2
    return target - _later(prediction, lag, runs)


def _correlations(one: Array, other: Array, count: int) -> Array:
    """Return Σ one(t) other(t − lag) over columns (time, wheel), of so many lags, from the earliest to the latest."""
    size, half = len(one) + len(other), count // 2
    spectra = np.fft.rfft(one, size, axis=0) * np.conj(np.fft.rfft(other, size, axis=0))
    found = np.fft.irfft(spectra.sum(axis=1), size)
    lags = np.arange(-half, half + 1)
    return np.where(np.abs(lags) < len(one), found[np.clip(lags, 1 - len(one), len(one) - 1)], 0.0)


def _later(values: Array, readings: int, runs: Sequence[slice]) -> Array:
    """Return values (time, wheel) so many readings later within each run, NaN where there are none."""
    found = np.full(values.shape, np.nan)
    for rows in runs:
        count = rows.stop - rows.start - abs(readings)
        if count > 0:
            to, of = (rows.start + max(sign * readings, 0) for sign in (1, -1))
            found[to : to + count] = values[of : of + count]
    return found


def _by_scatter(readings: Array, time: Array, run: NDArray[np.int64], stated: SensorError) -> SensorError | None:
    """Return the error that readings (time, wheel) scatter by; None where that is near the stated one, or nothing."""
    scale = ReadingScale.of(readings, stated)
    stabilised = scale.stabilised(readings)
    deviation = scatter(stabilised, time, run)
    if deviation < scale.deviation / NEAR:
        # Readings that stay at exactly 0 have no error, whatever the others have: the sun at night, an axis at rest.
        rest = at_rest(readings, np.flatnonzero(np.diff(run, prepend=run[:1] - 1)))
        deviation = min(max(deviation, scatter(np.where(rest, np.nan, stabilised), time, run)), scale.deviation)
    if deviation <= LEAST_SCATTER * float(np.nanstd(readings)) or deviation / NEAR < scale.deviation < deviation * NEAR:
        return None
    if not scale.deviation:
        return SensorError(absolute=deviation)
    factor = deviation / scale.deviation
    return SensorError(relative=factor * stated.relative, absolute=factor * stated.absolute)


def scatter(values: Array, time: Array, run: NDArray[np.int64]) -> float:
    """Return the standard deviation of white noise in readings (time, wheel), by differences within a run.

    Their median does not see steps. What the column itself does adds to them, the less the higher their order is, and
    noise adds the same to each: the least counts. 0 where more than half of them are 0: a column that is set, or
    rounded. A course that goes to and fro within a few readings adds to all orders; noise is then what is left of
    whole windows (`noise_floor`).
    """
    found = []
    for order in ORDERS[: max(len(run) - 1, 0)]:
        same = (run[order:] == run[: len(run) - order])[:, None]
        each = np.where(same, np.diff(values, order, axis=0), np.nan)
        found.append(robust_std(each[np.isfinite(each)]) / np.sqrt(comb(2 * order, order)))
    least = float(min(found, default=0.0))
    if not least:
        return 0.0
    floors = []
    for column in values.T:
        rows, runs = fitted_rows(column, run)
        floors.append(noise_floor(column[rows], even_pieces(column[rows], time[rows], runs)))
    return min(least, float(np.sqrt(np.mean(floors))))


def notes_on_errors(
    errors: Mapping[str, SensorError], stated: Mapping[str, SensorError], as_read: Recording, channel: str
) -> tuple[str, ...]:
    """Return what is told of each error that was taken from the readings' scatter."""
    notes = []
    for name, error in errors.items():
        deviation, said = (
            ReadingScale.of(as_read.channels[name], each).deviation for each in (error, stated.get(name, SensorError()))
        )
        of_statement = f"a stated error of {said:.2g}" if said else "no stated error"
        notes.append(
            f"{name} has {of_statement}. Its readings scatter by {deviation:.2g} (one standard deviation) about those "
            f"beside them, and predict {channel} better with that as their error: it is taken. State it in [sensors]."
        )
    return tuple(notes)
