"""Channels that are sampled less often than the recording's rows: held or interpolated, as the simulation says.

A blank is "not measured", never zero. A sensor that reports once a second beside a current at 100 Hz leaves 99 blanks
of 100; between two of its own readings the value is known to the accuracy of a straight line. Blanks of a sensor that
usually reports at every row stay blank, and so does a gap much longer than the sensor's own period.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.data.recording import Recording

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Between = Literal["linear", "hold", "blank"]

SLOWER = 2.0
"""Rows from one reading to the next (median) from which a channel counts as slower (a choice: every other row)."""
LONGEST_GAP = 3.0
"""Periods of the slow sensor across which its value is still taken as known (a choice: two readings missing)."""

FEWEST = 3
"""Readings of a slower sensor that show how much it changes between them, at least."""
REGULAR_CHANGES = 0.9
"""Share of a column's changes that are whole periods apart, from which it is a slower sensor's, held (a choice)."""
OFTEN_THE_SAME = 0.5
"""Share of readings that repeat the one before, above which a held column is asked for at intervals (a choice)."""
MOST_NOISE = 0.1
"""Share of the largest change between two readings, up to which one repeats the other but for noise (a choice)."""


def filled_between(recording: Recording, predicted: str, between: Mapping[str, Between]) -> Recording:
    """Return the recording with slower channels filled in between their own readings.

    The predicted channel is left as it is. `between` says for single channels what to do; others are interpolated.
    """
    filled, told = {}, []
    for name, values in recording.channels.items():
        how = between.get(name, "linear")
        if name == predicted or how == "blank":
            continue
        columns = [_filled(recording, values[:, k], how) for k in range(values.shape[1])]
        if any(column is not None for column in columns):
            kept = [values[:, k] if column is None else column for k, column in enumerate(columns)]
            filled[name] = np.stack(kept, axis=1)
            word = "held" if how == "hold" else "interpolated on straight lines"
            told.append(f"{name} is measured less often than the other channels; between its readings it is {word}.")
    return recording.with_channels(**filled).with_notes(*told) if filled else recording


def drawn_between(recording: Recording, filled: Recording, name: str, how: Between) -> tuple[Array, Index]:
    """Return a filled column (time, wheel) as it may have been between its readings, and the row of the last reading.

    In each gap it is off by one standard deviation, up or down by lot; about a straight line by `off_line`. What is
    held has changed to the next reading with the probability u, at a share u of the gap, if it is asked for: where each
    reading differs from the one before, it is reported when it changes.
    """
    before, found = recording.channels[name], filled.channels[name].copy()
    last, random = np.repeat(np.arange(len(before))[:, None], before.shape[1], axis=1), np.random.default_rng(0)
    for wheel, column in enumerate(before.T):
        known = np.flatnonzero(np.isfinite(column))
        if known.size == column.size or known.size < FEWEST:
            continue
        steps = np.diff(column[known])
        lot = random.choice([-1.0, 1.0], size=len(steps))
        asked = np.mean(np.abs(steps) <= MOST_NOISE * np.max(np.abs(steps))) > OFTEN_THE_SAME
        for gap in np.flatnonzero((np.diff(known) > 1) & np.isfinite(found[known[:-1] + 1, wheel])):
            first, after = known[gap], known[gap + 1]
            share = np.arange(1, after - first) / (after - first)
            if how == "hold":
                off = np.sqrt(share) * steps[gap] * asked
            else:
                off = lot[gap] * off_line(column[known], share[:, None])[:, gap]
            found[first + 1 : after, wheel] += off
            last[first + 1 : after, wheel] = first
    return found, last


def off_line(readings: Array, share: Array | float) -> Array:
    """Return how far a column may be from a straight line between two readings, at a share of the way, (…, gap).

    A Brownian motion is off, between two of its readings, by 2 u (1 − u) times the variance of a reading about the line
    between its neighbours, at a share u of the gap.
    """
    about = np.pad(np.diff(readings, 2) / 2, 1) ** 2
    return np.asarray(np.sqrt(share * (1 - share) * (about[:-1] + about[1:])))


def rows_held(recording: Recording, name: str) -> int:
    """Return for how many rows a column repeats each of its readings, as a logger that holds a slower sensor; or 1."""
    found = 1
    for column in recording.channels[name].T:
        apart = np.diff(np.flatnonzero(np.diff(column[np.isfinite(column)])))
        usual = int(np.median(apart)) if apart.size >= FEWEST else 1
        if usual >= SLOWER and np.mean(apart % usual == 0) >= REGULAR_CHANGES:
            found = max(found, usual)
    return found


def rows_apart(recording: Recording, name: str) -> int:
    """Return how many rows the readings of a column are usually apart, where there are blanks between them; or 1."""
    apart = [np.diff(np.flatnonzero(np.isfinite(column))) for column in recording.channels[name].T]
    return max((int(np.median(each)) for each in apart if each.size >= FEWEST), default=1)


def bridged(
    recording: Recording, names: Sequence[str], between: Mapping[str, Between], *, other_way: bool = False
) -> tuple[Recording, dict[str, NDArray[np.bool_]]]:
    """Return the recording with blanks of these channels filled in, and where they were blank, by channel.

    Within a run, between readings: on a straight line or held, as `between` says, or the other way; the ends of a run
    are held. A column that is to stay blank does, and a run without a reading.
    """
    filled, blanks = {}, {}
    for name in names:
        values, how = recording.channel(name), between.get(name, "linear")
        blank = ~np.isfinite(values)
        if name not in recording.channels or how == "blank" or not blank.any() or blank.all():
            continue
        held = (how == "hold") != other_way
        filled[name] = np.stack([_bridged(recording, values[:, k], held=held) for k in range(values.shape[1])], axis=1)
        blanks[name] = blank & np.isfinite(filled[name])
    return recording.with_channels(**filled), {name: blank for name, blank in blanks.items() if blank.any()}


def _bridged(recording: Recording, column: Array, *, held: bool) -> Array:
    """Return one wheel's readings with every blank between and beside readings of its run filled in."""
    found = column.copy()
    for rows in recording.runs:
        here = np.arange(rows.start, rows.stop)
        known = here[np.isfinite(column[here])]
        if known.size and held:
            last = np.searchsorted(known, here, side="right") - 1
            found[here] = column[known[np.maximum(last, 0)]]
        elif known.size:
            found[here] = np.interp(recording.time_s[here], recording.time_s[known], column[known])
    return found


def _filled(recording: Recording, column: Array, how: Between) -> Array | None:
    """Return one wheel's readings filled in, or None where this is no slower channel."""
    known = np.flatnonzero(np.isfinite(column))
    if known.size < 2 or known.size == column.size:
        return None
    apart = np.diff(known)
    usual = float(np.median(apart))
    if usual < SLOWER:
        return None
    found = column.copy()
    time_s = recording.time_s
    for first, last in pairwise(known):
        if last - first > LONGEST_GAP * usual or recording.run[first] != recording.run[last]:
            continue
        inside = slice(first + 1, last)
        if how == "hold":
            found[inside] = column[first]
        else:
            found[inside] = np.interp(time_s[inside], time_s[[first, last]], column[[first, last]])
    return found
