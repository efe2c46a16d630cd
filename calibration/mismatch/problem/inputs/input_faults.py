"""Faults of single readings, or of a few in a row, in what is not predicted: inputs and covariates.

A logger writes 0, 9999 or 65535 where a reading was lost. In the predicted column the residual shows it
(`outliers.py`). In an input it would be simulated, and what it does to the prediction would be told as physics; in a
state it lasts. A fault of one reading, or of a few that are equal, lies far beyond the readings before and after it,
any other of a few in a row out of the range of all others. So does a pulse that was really there: the valve that opened
once. Where the prediction depends on it, the simulation decides, which follows the measured column clearly better with
a true pulse, and clearly worse with a fault. Else it is a fault if it is out of the range of all others.

What is found becomes a blank, and a note says so.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import counted
from regolithd.calibration.mismatch.problem.readings.outliers import (
    MOST_IN_A_ROW,
    far_from_prediction,
    few_in_a_row,
    isolated_outliers,
    out_of_range,
)
from regolithd.calibration.mismatch.signal.noise_models.first_order import FirstOrder

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.thresholds import Thresholds

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

REACH = 2
"""Readings before a fault that it may change: a difference over three readings, and one more (a choice)."""
AROUND = 50
"""Readings before and after a pulse that are asked whether it was there (a choice: a straight line holds so long)."""
CLEARLY = 5.0
"""Log likelihood ratio from which a pulse was there, or was not (a choice: noise that is not white makes it seem
larger). Between the two a reading out of the range of all others is a fault, and any other is none."""
LEAST_CHANGE = 1.0
"""Sum of squares by which a reading has to change the prediction, in variances of what is left, to be judged by it."""
MOST_TOLD = 3
"""Faults of a column of which a note tells time and value."""


def without_input_faults(
    recording: Recording, predicted: str, predict: Callable[[Recording], Array], thresholds: Thresholds
) -> Recording:
    """Return the recording with faults of a few readings of all columns but the predicted one as blanks, and notes.

    `predict` runs the simulation on a recording; it is called twice, and only where a reading may be a fault.
    """
    far = {
        name: mask
        for name, values in recording.channels.items()
        if name != predicted and (mask := far_from_all_others(values, recording.run, thresholds)).any()
    }
    if not far:
        return recording
    blanked = {name: np.where(mask, np.nan, recording.channels[name]) for name, mask in far.items()}
    with_them, without = predict(recording), predict(recording.with_channels(**blanked))
    left = recording.channel(predicted) - without
    far_left = far_from_prediction(left, thresholds)
    left[isolated_outliers(far_left, np.isfinite(left), recording.run, thresholds)] = np.nan  # its own faults
    evidence = _evidence(recording, left, with_them - without, far)
    faults = {}
    for name, mask in far.items():
        beyond = out_of_range(recording.channels[name], mask)
        faults[name] = (mask & (evidence < -CLEARLY)) | (beyond & ~(evidence > CLEARLY))
    faults = {name: mask for name, mask in faults.items() if mask.any()}
    if not faults:
        return recording
    cleaned = {name: np.where(mask, np.nan, recording.channels[name]) for name, mask in faults.items()}
    return recording.with_channels(**cleaned).with_notes(*(_note(recording, *fault) for fault in faults.items()))


def excursions(values: Array, run: NDArray[np.int64]) -> Array:
    """Return by how much readings, shape (time,), lie above or below both of their neighbours within a run.

    Neighbours are the readings before and after, however many blanks are between. Equal ones in a row count as one: a
    logger repeats what it writes for a lost reading. 0 for those between their neighbours, for blanks, for a run's
    first and last, and for more than `MOST_IN_A_ROW`.
    """
    found = np.zeros(len(values))
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 3:
        return found
    starts = np.flatnonzero(np.append(True, (np.diff(values[known]) != 0) | (np.diff(run[known]) != 0)))
    many, first = np.diff(np.append(starts, known.size)), known[starts]
    steps = np.diff(values[first])
    away, back = steps[:-1], -steps[1:]
    turned = (away * back > 0) & (run[first[:-2]] == run[first[2:]]) & (many[1:-1] <= MOST_IN_A_ROW)
    beyond = np.zeros(len(first))
    beyond[1:-1] = np.where(turned, np.minimum(np.abs(away), np.abs(back)), 0.0)
    found[known] = np.repeat(beyond, many)
    return found


def far_from_all_others(values: Array, run: NDArray[np.int64], thresholds: Thresholds) -> Mask:
    """Return the few readings (time, wheel) that may be faults: single ones, and a few in a row."""
    single = far_from_both_neighbours(values, run, thresholds)
    rest = np.where(single, np.nan, values)
    known = rest[np.isfinite(rest)]
    share = thresholds.most_outliers_share
    low, high = np.quantile(known, (share, 1 - share)) if known.size else (0.0, 0.0)
    margin = thresholds.isolated_excursion * (high - low)
    beyond = few_in_a_row((rest < low - margin) | (rest > high + margin), run)
    return single | beyond if beyond.sum() <= share * known.size else single


def far_from_both_neighbours(values: Array, run: NDArray[np.int64], thresholds: Thresholds) -> Mask:
    """Return the few readings (time, wheel) that lie beyond their neighbours by far more than all others do.

    Next to a fault, a good reading lies far from one neighbour, and by chance from the other: of two next to each other
    the one that is further is looked at first, and the other without it.
    """
    found = np.zeros(values.shape, np.bool_)
    for wheel, column in enumerate(values.T):
        left, beyond = column.copy(), excursions(column, run)
        most = int(thresholds.most_outliers_share * np.isfinite(column).sum())
        least = thresholds.isolated_excursion * float(np.partition(beyond, -most - 1)[-most - 1])
        while found[:, wheel].sum() <= most and np.any(far := beyond > least):
            beside = np.maximum(np.append(beyond[1:], 0.0), np.insert(beyond[:-1], 0, 0.0))
            far &= beyond >= beside
            found[far, wheel], left[far] = True, np.nan
            beyond = excursions(left, run)
        if found[:, wheel].sum() > most:
            found[:, wheel] = False
    return found


def _evidence(recording: Recording, left: Array, changed: Array, far: dict[str, Mask]) -> Array:
    """Return the log likelihood ratio of a pulse that was there to a fault, at each instant with a far one: (time, 1).

    `left` (time, wheel) is what the prediction without them leaves, `changed` is what they change of it. Around each
    pulse, up to the ones before and after, `left` = b · `changed` + a straight line + noise, where b = 0 if nothing was
    there, and b = 1 if it was. The line stands for parameters that are not fitted yet, and the noise is taken as an
    autoregression of first order. NaN where it cannot be judged: the prediction hardly depends on it, or there is none
    with it, as at standstill.
    """
    evidence = np.full((len(left), 1), np.nan)
    places = np.flatnonzero(np.any([mask.any(axis=1) for mask in far.values()], axis=0))
    pulses = np.split(places, np.flatnonzero((np.diff(places) > 1) | (np.diff(recording.run[places]) != 0)) + 1)
    ends = [-1, *(int(pulse[-1]) for pulse in pulses[:-1])]
    starts = [*(int(pulse[0]) for pulse in pulses[1:]), len(left) + REACH]
    around = []
    for pulse, end, start in zip(pulses, ends, starts, strict=True):
        first, last = int(pulse[0]), int(pulse[-1])
        until = max(min(start - REACH, last + 1 + AROUND, len(left)), last + 1)
        rows = np.arange(max(end + 1, first - AROUND, 0), until)
        around.append(rows[recording.run[rows] == recording.run[first]])
    both = np.where(np.isfinite(left) & np.isfinite(changed), 1.0, np.nan)
    lines = [tuple(_without_line(each[rows] * both[rows]) for each in (changed, left)) for rows in around]
    noise = FirstOrder.of([rest for _, rest in lines])
    for pulse, (change, rest) in zip(pulses, lines, strict=True):
        if noise.size(change) > LEAST_CHANGE:
            evidence[pulse] = noise.log_likelihood_ratio(change, rest)
    return evidence


def _without_line(values: Array) -> Array:
    """Return values (time, wheel) less a straight line over time on each wheel; NaN where they are."""
    found = np.full(values.shape, np.nan)
    for wheel, column in enumerate(values.T):
        at = np.flatnonzero(np.isfinite(column))
        if at.size > 2:
            basis = np.stack((np.ones(at.size), at - at.mean()), axis=1)
            found[at, wheel] = column[at] - basis @ np.linalg.lstsq(basis, column[at], rcond=None)[0]
    return found


def _note(recording: Recording, name: str, faults: Mask) -> str:
    """Return what is told of a column's faults; a sensor that the wheels share is told once."""
    values = recording.channels[name]
    instants = np.flatnonzero(faults.any(axis=1))
    first = [f"{values[t][faults[t]][0]:.6g} at {recording.time_s[t]:.6g} s" for t in instants[:MOST_TOLD]]
    more = "" if len(instants) <= MOST_TOLD else ", …"
    return (
        f"{counted(len(instants), 'reading')} of {name}, far from those before and after, "
        f"{'is' if len(instants) == 1 else 'are'} taken as blank: {', '.join(first)}{more}."
    )
