"""What a state carries over a gap: a stretch within a run of which no rows were recorded.

A simulation that integrates takes one long step there, with the inputs before the gap or after it. How far they were
from these in the gap is not known. Elsewhere in the recording it is: by how much the mean of a stretch as long differs
from the mean of its ends. A second prediction with the inputs beside each gap off by so much tells how far what is
predicted after it can be trusted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.recording import gaps_in

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.data.recording import Recording

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FEWEST_STRETCHES = 10
"""Stretches without a gap by which an input's change is known (a choice); of fewer, its distance from its mean is."""
USUAL = 0.95
"""Share of the stretches in which it changes by less (a choice: what it did in this one is not known)."""


def inputs_otherwise_in_gaps(recording: Recording, inputs: Sequence[str]) -> Recording | None:
    """Return the recording with these inputs, beside each gap, as they may have been in it; None: there is no gap.

    Each keeps within the range of its readings.
    """
    gaps = gaps_in(recording.time_s, recording.run)
    if not gaps.size:
        return None
    lengths = np.diff(recording.time_s)[gaps] / recording.step_s
    octaves = 2 ** np.round(np.log2(lengths)).astype(int)  # as many lengths are asked for at most
    random, changed = np.random.default_rng(0), {}
    for name in inputs:
        read = recording.channels[name]
        usual = {rows: _usual_change(recording, read, rows) for rows in set(octaves.tolist())}
        off = np.array([usual[rows] for rows in octaves.tolist()]) * random.choice([-1.0, 1.0], size=(len(gaps), 1))
        values, low, high = np.array(read), np.nanmin(read, axis=0), np.nanmax(read, axis=0)
        for rows in (gaps, gaps + 1):
            further = read[rows] + off
            within = (further >= low) & (further <= high)
            values[rows] = np.clip(np.where(within, further, read[rows] - off), low, high)
        changed[name] = values
    return recording.with_channels(**changed)


def after_gaps(recording: Recording) -> Mask:
    """Return which instants come after a gap in the same run, shape (time,), but for the two beside each.

    There the inputs themselves are off, and a prediction without a state is, too.
    """
    found, gaps = np.zeros(len(recording.run), np.bool_), gaps_in(recording.time_s, recording.run)
    for rows in recording.runs:
        first = np.searchsorted(gaps, rows.start)
        if first < len(gaps) and gaps[first] < rows.stop:
            found[gaps[first] : rows.stop] = True
    found[gaps] = found[gaps + 1] = False
    return found


def carried_over_gaps(recording: Recording, differs: Mask) -> Mask:
    """Return where a prediction depends on what was in a gap, of where the two differ, shape (time, wheel) each.

    The instant that follows a gap does where the next one does.
    """
    found = differs & after_gaps(recording)[:, None]
    gaps = gaps_in(recording.time_s, recording.run)
    first = gaps[gaps + 2 < len(found)] + 1
    found[first] = found[first + 1]
    return found


def _usual_change(recording: Recording, values: Array, rows: int) -> Array:
    """Return by how much at most the mean of a stretch usually differs from that of its ends, shape (wheel,)."""
    known = np.nan_to_num(values)
    pieces = np.concatenate(([0], np.cumsum(~recording.without_gap)))
    starts = np.flatnonzero(pieces[rows:] == pieces[:-rows]) if rows < len(pieces) else np.zeros(0, np.int64)
    if len(starts) < FEWEST_STRETCHES * rows:
        return np.asarray(np.nanquantile(np.abs(values - np.nanmean(values, axis=0)), USUAL, axis=0))
    sums = np.concatenate((np.zeros((1, known.shape[1])), np.cumsum(known, axis=0)))
    means = (sums[starts + rows + 1] - sums[starts]) / (rows + 1)
    apart = means - 0.5 * (known[starts] + known[starts + rows])
    return np.asarray(np.quantile(np.abs(apart), USUAL, axis=0))
