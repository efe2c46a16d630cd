"""A recording that grows, cut into pieces of equal time: rows go in as they come, whole pieces come out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.recording import TIME, TIME_UNITS_S, Recording, from_columns
from regolithd.calibration.mismatch.errors import RecordingError, listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from regolithd.calibration.mismatch.data.columns import Column

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Piece:
    """The rows of one interval of time.

    Attributes
    ----------
    start_s, end_s: the interval, from the recording's first instant
    recording: its rows; None where there are none that can be read
    first_s: the first instant of them
    reason: why there are none
    """

    start_s: float
    end_s: float
    recording: Recording | None
    first_s: float = 0.0
    reason: str = ""


@dataclass
class Cutter:
    """Cuts rows, in the order of time, into pieces of `interval_s`; `unit` is the column that tells wheels apart.

    A clock that is set back begins again in the next interval. Rows that come after their piece is out are counted.
    """

    interval_s: float
    unit: str
    late_rows: int = 0
    clock_set_back: int = 0
    _waiting: list[dict[str, Column]] = field(default_factory=list)
    _offset_s: float | None = None
    _latest_s: float = 0.0
    _number: int = 0

    def add(self, rows: Mapping[str, Column]) -> Iterator[Piece]:
        """Take further rows, a mapping from columns to arrays of equal length; yield the pieces that are complete.

        Raises
        ------
        RecordingError
            When there is no column of time.
        """
        table = {name: np.asarray(values) for name, values in rows.items()}
        clock = next((name for name in TIME_UNITS_S if name in table), TIME)
        if clock not in table:
            raise RecordingError(f"there is no column of time ({', '.join(TIME_UNITS_S)}); there is {listed(table)}")
        time_s = TIME_UNITS_S.get(clock, 1.0) * table.pop(clock).astype(np.float64)
        table = {name: values[np.isfinite(time_s)] for name, values in table.items()}
        elapsed = self._elapsed(time_s[np.isfinite(time_s)])
        numbers = np.floor(elapsed / self.interval_s + 1e-9).astype(np.int64)
        self.late_rows += int(np.sum(numbers < self._number))
        for number in np.unique(numbers[numbers >= self._number]):
            while self._number < number:
                yield self._cut()
            here = numbers == number
            self._waiting.append({TIME: elapsed[here], **{name: values[here] for name, values in table.items()}})

    def rest(self) -> Iterator[Piece]:
        """Yield what is left as a last piece, at the end of the recording."""
        if self._waiting:
            yield self._cut()

    def _elapsed(self, time_s: Array) -> Array:
        """Return seconds since the first row ever."""
        if not time_s.size:
            return time_s
        if self._offset_s is None:
            self._offset_s = -float(time_s[0])
        elapsed = time_s + self._offset_s
        back = np.flatnonzero(np.diff(elapsed, prepend=self._latest_s) < -self.interval_s)
        for at in back:
            moved = self.interval_s * np.ceil(self._latest_before(elapsed, int(at)) / self.interval_s) - elapsed[at]
            elapsed[at:] += moved
            self._offset_s += float(moved)
            self.clock_set_back += 1
        self._latest_s = max(self._latest_s, float(elapsed.max()))
        return elapsed

    def _latest_before(self, elapsed: Array, at: int) -> float:
        return max(self._latest_s, float(np.max(elapsed[:at], initial=0.0)))

    def _cut(self) -> Piece:
        waiting, self._waiting = self._waiting, []
        start_s = self._number * self.interval_s
        self._number += 1
        end_s = self._number * self.interval_s
        if not waiting:
            return Piece(start_s, end_s, None, reason="nothing was recorded")
        try:
            recording = from_columns(_stacked(waiting), unit=self.unit)
        except RecordingError as error:
            return Piece(start_s, end_s, None, reason=str(error))
        first_s = min(float(part[TIME].min()) for part in waiting)
        return Piece(start_s, end_s, recording, first_s)


def _stacked(parts: Sequence[Mapping[str, Column]]) -> dict[str, Column]:
    """Return the columns of all parts; one that a part lacks is blank there."""
    names = dict.fromkeys(name for part in parts for name in part)
    return {
        name: np.concatenate([part.get(name, np.full(len(part[TIME]), np.nan)) for part in parts]) for name in names
    }


def together(pieces: Sequence[Piece], wheels: Sequence[int | str] = ()) -> tuple[Recording, Array]:
    """Return the pieces that hold rows as one recording, and the instants' time since the start, shape (time,).

    `wheels` are those that it has; by default all that there are.
    """
    filled = [(piece, piece.recording) for piece in pieces if piece.recording is not None]
    found = sorted({wheel for _, each in filled for wheel in each.wheels}, key=lambda w: (isinstance(w, str), w))
    chosen = tuple(wheels or found)
    names = dict.fromkeys(name for _, each in filled for name in each.channels)
    elapsed = np.concatenate([piece.first_s + each.time_s for piece, each in filled])
    channels = {name: np.concatenate([_on(each, name, chosen) for _, each in filled]) for name in names}
    run = np.zeros(len(elapsed), np.int64)
    return Recording(elapsed - elapsed[0], run, chosen, channels), elapsed


def _on(recording: Recording, name: str, wheels: Sequence[int | str]) -> Array:
    """Return a channel with a column for each of these wheels, NaN for one that it lacks."""
    values: Array = np.full((len(recording.time_s), len(wheels)), np.nan)
    have = [k for k, wheel in enumerate(recording.wheels) if wheel in wheels]
    values[:, [list(wheels).index(recording.wheels[k]) for k in have]] = recording.channel(name)[:, have]
    return values
