"""Several recordings as one: each keeps its runs, and wheels and channels are those of all together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.data.recording import Array, Index, Recording, told_constant
from regolithd.calibration.mismatch.errors import RecordingError, listed

if TYPE_CHECKING:
    from collections.abc import Sequence


def joined(recordings: Sequence[Recording], names: Sequence[str]) -> Recording:
    """Return recordings put one after the other; a channel or wheel that one of them lacks is not measured there.

    Parameters
    ----------
    recordings: at least one
    names: of the recordings, shape (recording,); the notes of each begin with its name

    Raises
    ------
    RecordingError
        When no column was recorded in all of them.
    """
    if len(recordings) == 1:
        return recordings[0]
    wheels = _all_wheels(recordings)
    channels = sorted({name for recording in recordings for name in recording.channels})
    if not set.intersection(*(set(recording.channels) for recording in recordings)):
        raise RecordingError(f"no column is in all of {listed(names)}; they are not of one machine")
    runs, first = [], 1  # as the notes tell them
    for recording in recordings:
        numbers = np.unique(recording.run, return_inverse=True)[1] + first
        first = int(numbers[-1]) + 1
        runs.append(numbers.astype(np.int64))
    return Recording(
        time_s=np.concatenate([recording.time_s for recording in recordings]),
        run=np.concatenate(runs),
        wheels=wheels,
        channels={
            name: np.concatenate([_spread(recording, name, wheels) for recording in recordings]) for name in channels
        },
        notes=tuple(_notes(recordings, names, runs, channels)),
        unread=tuple(dict.fromkeys(told for recording in recordings for told in recording.unread)),
    )


def _all_wheels(recordings: Sequence[Recording]) -> tuple[int | str, ...]:
    found = {wheel for recording in recordings for wheel in recording.wheels}
    return tuple(sorted(found, key=lambda wheel: (isinstance(wheel, str), wheel)))


def _spread(recording: Recording, name: str, wheels: Sequence[int | str]) -> Array:
    """Return a channel with a column for each of all wheels."""
    found: Array = np.full((len(recording.time_s), len(wheels)), np.nan)
    found[:, [wheels.index(wheel) for wheel in recording.wheels]] = recording.channel(name)
    return found


def _notes(
    recordings: Sequence[Recording], names: Sequence[str], runs: Sequence[Index], channels: Sequence[str]
) -> list[str]:
    """Return which runs a recording has become, what it lacks, and its own notes."""
    notes, varies = [], tuple(told_constant(name) for name in channels if not _is_constant(recordings, name))
    for recording, name, run in zip(recordings, names, runs, strict=True):
        first, last = int(run[0]), int(run[-1])
        notes.append(f"{name}: run {first}." if first == last else f"{name}: runs {first} to {last}.")
        lacking = [channel for channel in channels if channel not in recording.channels]
        if lacking:
            notes.append(f"{name}: {listed(lacking)} was not recorded.")
        notes += [f"{name}: {note}" for note in recording.notes if not note.startswith(varies)]
    return notes


def _is_constant(recordings: Sequence[Recording], channel: str) -> bool:
    """Return whether a channel has one value in all recordings: where each has its own, that shows."""
    values = np.concatenate([recording.channel(channel).ravel() for recording in recordings])
    known = values[np.isfinite(values)]
    return bool(known.size == 0 or known.min() == known.max())
