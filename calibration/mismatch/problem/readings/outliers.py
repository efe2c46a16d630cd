"""Readings that are faults: single outliers, codes of a few in a row, a stuck sensor, and what is at its limit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import counted
from regolithd.calibration.mismatch.signal.robust import robust_std

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.thresholds import Thresholds

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST_IN_A_ROW = 5
"""Readings one after the other that are a fault, at most, and not an event (a choice: a few telegrams were lost)."""
FEWEST_AT_LIMIT = 3
"""Readings of one wheel at exactly the same extreme value, from which on it is a limit (a choice)."""
SAME_LIMIT = 1e-6
"""Relative difference of two limits up to which they are one: digits of a file."""
LIMIT_DEVIATIONS = 3.0
"""Standard deviations of the residual below a limit, from which no noise reaches it (normal density: 1 in 740)."""
FEWEST_SATURATED = 5
"""Readings of one wheel, or of all, at exactly the same extreme value, from which on they are saturated (a choice)."""
MOST_SATURATED, MOST_NEAR_LIMIT = 0.1, 0.3
"""Share of a wheel's readings that are saturated, and that are not compared for it, at most (a choice): more is a limit
of the machine that the simulation leaves out, and is compared."""
PILED_UP = 3
"""Times that as many readings are at the limit as at any of the next values, with as many values (a choice): of
quantised noise, the furthest value is the rarest."""
NEAR_LIMIT_DEVIATIONS = 1.5
"""Standard deviations of the residual below a limit, from which a mean reading is hardly lowered by it (normal density:
by 0.03 of them)."""
LEAST_SPREAD = 0.25
"""Standard deviation of what is predicted of saturated readings, in those of the residual, at least (a choice): where
one value is predicted, the machine rests there."""
FEWEST_STUCK = 20
"""Equal readings in a row, in those that are equal in a row elsewhere on average, from which on a sensor is stuck (a
choice: a live one with noise repeats a value a few times, and a slow one that is held as often everywhere)."""
OUT_OF_RANGE = 1.0
"""Ranges of all other readings beyond which a reading is out of range (a choice)."""


@dataclass(frozen=True, eq=False)
class FaultyReadings:
    """Readings of the predicted column that are not compared, and why, each for one reason, shape (time, wheel).

    Attributes
    ----------
    isolated: single readings far from the prediction
    codes: a few in a row that are out of the range of all others
    limited: at a limit that the prediction has too
    saturated: at a limit that the prediction does not have, or predicted to be near it
    stuck: at one value while the prediction changes
    compared: far readings that are compared all the same
    """

    isolated: Mask
    codes: Mask
    limited: Mask
    saturated: Mask
    stuck: Mask
    compared: Mask

    @classmethod
    def of(
        cls, measured: Array, prediction: Array, compared: Mask, run: NDArray[np.int64], thresholds: Thresholds
    ) -> FaultyReadings:
        """Return the faults among the readings that are `compared`."""
        residual = np.where(compared, measured - prediction, np.nan)
        far = far_from_prediction(residual, thresholds)
        isolated = isolated_outliers(far, compared, run, thresholds)
        codes = codes_in_a_row(measured, far, compared, run, thresholds) & ~isolated
        taken, predicted = isolated | codes, np.where(compared, prediction, np.nan)
        limited = at_common_limit(measured, predicted, residual) & ~taken
        saturated = at_own_limit(measured, np.where(taken | limited, np.nan, predicted), residual)
        stuck = at_one_value(measured, predicted, run) & ~taken & ~limited & ~saturated
        return cls(isolated, codes, limited, saturated, stuck, far & ~taken & ~limited & ~saturated & ~stuck)

    @property
    def all(self) -> Mask:
        """Where a reading is not compared, for any of the reasons."""
        return self.isolated | self.codes | self.limited | self.saturated | self.stuck


def far_from_prediction(residual: Array, thresholds: Thresholds) -> Mask:
    """Return which residuals (time, wheel) are further from the median of their wheel than an outlier is."""
    found = np.zeros(residual.shape, np.bool_)
    for wheel, column in enumerate(residual.T):
        known = np.isfinite(column)
        if known.any():
            middle, deviation = float(np.median(column[known])), robust_std(column[known])
            away = np.abs(column[known] - middle)
            found[known, wheel] = (away > thresholds.outlier_deviations * deviation) & (deviation > 0)
    return found


def isolated_outliers(far: Mask, compared: Mask, run: NDArray[np.int64], thresholds: Thresholds) -> Mask:
    """Return which of the readings far from the prediction are single ones, shape (time, wheel).

    Only a reading whose neighbours are not far is a fault of the recording, and only where such are few of a wheel's
    `compared`. What lasts longer, or comes often, is physics that the simulation leaves out.
    """
    same_run = np.diff(run)[:, None] == 0
    beside = np.zeros(far.shape, np.bool_)
    beside[1:] |= far[:-1] & same_run
    beside[:-1] |= far[1:] & same_run
    alone = far & ~beside
    return alone & (alone.sum(axis=0) <= thresholds.most_outliers_share * compared.sum(axis=0))


def out_of_range(values: Array, some: Mask) -> Mask:
    """Return which of some readings (time, wheel) are out of the range of all others.

    The furthest is looked at first, and those within are looked at without it. Readings that are equal are one code. Of
    pulses that were there, the largest is within reach of the next.
    """
    found, known = np.zeros(values.shape, np.bool_), np.isfinite(values)
    middle = float(np.median(values[known])) if known.any() else 0.0
    for value in sorted(set(values[some & known].tolist()), key=lambda each: -abs(each - middle)):
        others = values[known & ~found & (values != value)]
        equal = some & (values == value)
        if not others.size or equal.sum() > MOST_IN_A_ROW:
            break
        low, high = float(others.min()), float(others.max())
        margin = OUT_OF_RANGE * (high - low)
        if low - margin <= value <= high + margin:
            break
        found |= equal
    return found


def few_in_a_row(some: Mask, run: NDArray[np.int64]) -> Mask:
    """Return which of some readings (time, wheel) are at most `MOST_IN_A_ROW` one after the other in a run."""
    found = np.zeros(some.shape, np.bool_)
    for wheel, column in enumerate(some.T):
        at = np.flatnonzero(column)
        parts = np.split(at, np.flatnonzero((np.diff(at) > 1) | (np.diff(run[at]) != 0)) + 1) if at.size else []
        for part in parts:
            found[part, wheel] = len(part) <= MOST_IN_A_ROW
    return found


def codes_in_a_row(measured: Array, far: Mask, compared: Mask, run: NDArray[np.int64], thresholds: Thresholds) -> Mask:
    """Return where a few readings in a row are codes rather than readings, shape (time, wheel).

    They are far from the prediction, and out of the range of all others: 9999, 65535. That such are few is asked for
    all together, since an event of the machine that lasts is physics.
    """
    found = few_in_a_row(out_of_range(measured, far), run)
    return found if _are_few(found, compared, thresholds) else np.zeros(found.shape, np.bool_)


def at_common_limit(measured: Array, prediction: Array, residual: Array) -> Mask:
    """Return where reading and prediction are at a limit that both have, or too near to it, shape (time, wheel).

    A transducer that ends at 4.5 A, as the simulation states, reads 4.5 A whatever is added beyond: such a reading
    tells nothing of it. Those just below are left out by the prediction, since leaving them out by the reading would
    keep the ones with noise of one sign. Noise that is added after the limit (a saturated actuator, a noisy sensor)
    makes no two readings the same, and nothing is left out. Nor is it where most of the readings are at one value, and
    at zero.
    """
    found = np.zeros(measured.shape, np.bool_)
    for wheel in range(measured.shape[1]):
        read, predicted = measured[:, wheel], prediction[:, wheel]
        known = np.isfinite(read) & np.isfinite(predicted)
        if not known.any():
            continue
        near = LIMIT_DEVIATIONS * robust_std(residual[known, wheel])
        for sign in (1.0, -1.0):
            limit = float(np.max(sign * predicted[known]))
            at = known & (sign * predicted == limit)
            same = known & np.isclose(sign * read, limit, rtol=SAME_LIMIT, atol=0.0)
            common = np.isclose(float(np.max(sign * read[known])), limit, rtol=SAME_LIMIT, atol=0.0)
            enough = min(at.sum(), same.sum()) >= FEWEST_AT_LIMIT and at.sum() < known.sum() / 2
            if common and enough and limit != 0:
                found[:, wheel] |= known & (same | (sign * predicted > limit - near))
    return found


def at_own_limit(measured: Array, prediction: Array, residual: Array) -> Mask:
    """Return where readings are at a limit that the prediction does not have, or predicted to be near it (time, wheel).

    A sensor at the end of its range reads exactly the same again and again. What is left out is told by the prediction:
    left out by the reading, what is just below the limit would keep its noise of one sign. Saturated readings of which
    less is predicted stay: they are hardly lowered.
    """
    found, known = np.zeros(measured.shape, np.bool_), np.isfinite(measured) & np.isfinite(prediction)
    for sign in (1.0, -1.0):
        of_all = _piled_up_at(sign * measured[known])  # sensors of one kind end alike
        for wheel in np.flatnonzero(known.any(axis=0)):
            here = known[:, wheel]
            read, predicted = sign * measured[here, wheel], sign * prediction[here, wheel]
            limit, deviation = _piled_up_at(read) or of_all, robust_std(residual[here, wheel])
            if limit is None or not deviation > 0:
                continue
            saturated = np.isclose(read, limit, rtol=SAME_LIMIT, atol=0.0)
            near = predicted > limit - NEAR_LIMIT_DEVIATIONS * deviation
            varied = saturated.any() and float(np.std(predicted[saturated])) > LEAST_SPREAD * deviation
            if (varied or saturated.sum() < FEWEST_SATURATED) and near.sum() <= MOST_NEAR_LIMIT * len(near):
                found[here, wheel] |= near & saturated.any()
    return found


def at_one_value(measured: Array, prediction: Array, run: NDArray[np.int64]) -> Mask:
    """Return where a sensor is stuck, shape (time, wheel): its readings are exactly equal while the prediction changes.

    That changes by more than the readings elsewhere scatter from one to the next: a live sensor would show it. At zero
    nothing is stuck (a drive that is off), nor at an end of the range (`at_own_limit`).
    """
    found = np.zeros(measured.shape, np.bool_)
    for wheel in range(measured.shape[1]):
        at = np.flatnonzero(np.isfinite(measured[:, wheel]) & np.isfinite(prediction[:, wheel]))
        read, steps = measured[at, wheel], np.diff(measured[at, wheel])
        begins = np.flatnonzero((steps != 0) | (np.diff(run[at]) != 0)) + 1
        edges = np.concatenate(([0], begins, [len(at)]))
        lengths = np.diff(edges)
        usual = (len(at) - lengths) / max(len(lengths) - 1, 1)
        scatter = robust_std(steps[steps != 0]) / np.sqrt(2) if steps.any() else np.inf
        for place in np.flatnonzero(lengths >= np.maximum(FEWEST_STUCK * usual, 1)):
            part, value = at[edges[place] : edges[place + 1]], read[edges[place]]
            within = value != 0 and read.min() < value < read.max()
            if within and np.std(prediction[part, wheel]) > scatter:
                found[part, wheel] = True
    return found


def _piled_up_at(values: Array) -> float | None:
    """Return the largest of some values, not 0, if more of them are equal to it than noise explains; else None."""
    if not len(values):
        return None
    each, counts = np.unique(values, return_counts=True)
    limit = float(each[-1])
    same = np.isclose(each, limit, rtol=SAME_LIMIT, atol=0.0)
    count, beside = int(counts[same].sum()), counts[~same][-PILED_UP:]
    enough = FEWEST_SATURATED <= count <= MOST_SATURATED * len(values)
    return limit if enough and limit != 0 and count >= PILED_UP * int(beside.max(initial=0)) else None


def note_on_far_readings(channel: str, far: Mask, compared: Mask, thresholds: Thresholds) -> tuple[str, ...]:
    """Return a note on a few readings far from the prediction that are compared: faults in a row, or an event."""
    count = int(far.sum())
    if not count or not _are_few(far, compared, thresholds):
        return ()
    told = (
        f"{counted(count, 'reading')} of {channel} further than {thresholds.outlier_deviations:g} standard deviations "
        f"from the prediction {'is' if count == 1 else 'are'} compared, since neither single nor out of the range of "
        f"all others: leave the cells empty if they are faults of the recording."
    )
    return (told,)


def _are_few(some: Mask, compared: Mask, thresholds: Thresholds) -> bool:
    """Return whether readings are a share of those compared that may be faults."""
    return bool(some.sum() <= thresholds.most_outliers_share * compared.sum())
