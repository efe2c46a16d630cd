"""Recordings as arrays (time × wheel), with notes of what was wrong with the table.

The long table of the contract (one row per instant and wheel) becomes one array per channel. What is not measured is
NaN. Order of rows, origin of time and names of wheels carry no meaning: rows are sorted by run, time and wheel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.columns import Column, Columns, file_columns, frame_columns
from regolithd.calibration.mismatch.errors import RecordingError, counted, listed

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Array = NDArray[np.float64]
Index = NDArray[np.int64]
TIME = "t_s"
TIME_UNITS_S = {"t_s": 1.0, "t_ms": 1e-3, "t_us": 1e-6, "t_ns": 1e-9, "t_min": 60.0, "t_h": 3600.0}
"""Names that the column of time may have, and their unit in seconds."""
TIME_LIKE = ("time", "timestamp", "seconds")
"""What names of columns that are likely to be the time begin with."""
UNIT = "wheel"
RUN = "run"
MOST_CLOCK_JUMPS = 3
"""Backward jumps of the clock up to which each begins a new run; more are rows out of order (a choice)."""
GAP_STEPS = 5
"""Steps of time longer than so many usual ones are noted as gaps (a choice)."""
LONGEST_STEP = 3.0
"""Usual steps of time from which nothing is differentiated or integrated across a step (a choice)."""
TIME_DECIMALS = 9
"""Times that agree to a nanosecond are one instant: less is rounding of the text."""
LONGEST_STEP_S, SHORTEST_STEP_S = 100.0, 1e-6
"""Usual steps of time beyond which `t_s` may be in another unit (a choice: a tank is logged each minute, a current at
some ten kHz)."""
LONGEST_SPAN_S, LATEST_S = 1e10, 1e20
"""Three hundred years, and Unix time in nanoseconds times 50: what is longer or later is not in seconds."""
GREATEST_READING, LEAST_READING = 1e15, 1e-100
"""Readings beyond the first are codes for "not measured" (netCDF fills blanks with 9.97e36, climate models with 1e20),
and their products with others would pass single precision; those below the second are 0: the square of a smaller one
has no digits."""
MOST_ROWS_PER_INSTANT = 1.5
"""Rows for each instant beyond which they are of several wheels, not repetitions (a choice: half of them)."""
MOST_RUNS = 2**31
"""Greatest number of a run that is kept as it is."""
MOST_PLACES_PER_ROW = 100
"""Instants times wheels for each row, beyond which the column of wheels holds something else (a choice)."""


@dataclass(frozen=True)
class Recording:
    """One recording, or several runs put one after the other.

    Attributes
    ----------
    time_s: seconds since the run's first instant, shape (time,)
    run: number of the run that each instant belongs to, shape (time,)
    wheels: the wheels' (axes', bodies') names as recorded, numbers or text, in ascending order
    channels: one array (time × wheel) for each column
    notes: what was wrong with the table and what was done about it
    unread: the columns that hold no numbers, as "column surface holds text …"
    """

    time_s: Array
    run: NDArray[np.int64]
    wheels: tuple[int | str, ...]
    channels: Mapping[str, Array]
    notes: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()

    @property
    def shape(self) -> tuple[int, int]:
        """(time, wheel)."""
        return len(self.time_s), len(self.wheels)

    @cached_property
    def step_s(self) -> float:
        """The usual time from one instant to the next [s]."""
        steps = np.diff(self.time_s)[np.diff(self.run) == 0]
        return float(np.median(steps)) if steps.size else 1.0

    @cached_property
    def without_gap(self) -> NDArray[np.bool_]:
        """Whether the next instant follows within the same run and `LONGEST_STEP`, shape (time − 1,)."""
        return np.asarray((np.diff(self.run) == 0) & (np.diff(self.time_s) < LONGEST_STEP * self.step_s))

    @cached_property
    def runs(self) -> tuple[slice, ...]:
        """The rows of each run."""
        edges = [0, *(1 + np.flatnonzero(np.diff(self.run))).tolist(), len(self.run)]
        return tuple(slice(first, end) for first, end in pairwise(edges) if end > first)

    def channel(self, name: str) -> Array:
        """Return a channel, or NaN everywhere where it was not recorded."""
        found = self.channels.get(name)
        return np.full(self.shape, np.nan) if found is None else found

    def holds_no_reading(self, name: str) -> bool:
        """Return whether a channel is there and blank throughout."""
        return name in self.channels and not np.isfinite(self.channels[name]).any()

    def rate_of_change(self, values: Array) -> Array:
        """Return the change per second of values (time, wheel): central differences within each run."""
        found = np.full(self.shape, np.nan)
        for rows in self.runs:
            if rows.stop - rows.start > 1:
                found[rows] = np.gradient(values[rows], self.time_s[rows], axis=0)
        return found

    def with_notes(self, *notes: str) -> Recording:
        """Return the recording with further notes."""
        return replace(self, notes=(*self.notes, *notes))

    def with_channels(self, **channels: Array) -> Recording:
        """Return the recording with channels added or replaced (derived ones, say)."""
        return replace(self, channels={**self.channels, **channels})


def told_constant(name: str) -> str:
    """Return how the note on a channel of one value begins."""
    return f"{name} is constant"


def read_recording(
    path: Path, *, unit: str = UNIT, rover: str | None = None, rows: tuple[int, int] | None = None
) -> Recording:
    """Read CSV (also .gz) or Parquet; of a file whose column `rover` names several rovers, the rows of one.

    `rows` of a Parquet file are read alone, from the first to before the last.

    Raises
    ------
    RecordingError
        When the file is none of these, has no time, or a cell is no number; the message names line and column.
    """
    try:
        return _arrange(file_columns(path, unit, rover, rows), unit)
    except RecordingError as error:
        raise error if str(path) in str(error) else RecordingError(f"{path}: {error}") from error


def as_recording(data: object, *, unit: str = UNIT) -> Recording:
    """Return a recording as it is, or make one of a data frame (pandas, polars, pyarrow) or a mapping of arrays.

    Columns and rows are those of a recording's file: one row for each instant and wheel, `t_s` in seconds, NaN or null
    where nothing was measured, and the column `unit` where there is more than one wheel.

    Raises
    ------
    RecordingError
        When it is no table, has no time, or a cell is no number.
    """
    return data if isinstance(data, Recording) else _arrange(frame_columns(data, unit), unit)


def _arrange(found: Columns, unit: str) -> Recording:
    if unit in found.unread:
        raise RecordingError(f"{found.unread[unit]} or text; it has to name the wheels")
    return replace(from_columns(found.numbers, unit=unit), unread=tuple(found.unread.values()))


def from_columns(columns: Mapping[str, Column], *, unit: str = UNIT) -> Recording:
    """Arrange a long table's columns (a mapping of arrays) as arrays (time × wheel).

    Raises
    ------
    RecordingError
        When there is no time or fewer than two instants, or a column is no row of numbers.
    """
    notes: list[str] = []
    clock, *others = [name for name in TIME_UNITS_S if name in columns] or [TIME]
    if others:
        notes.append(f"The time is {clock}. Also named as a time, and read as a channel: {listed(others)}.")
    names, table = _table(columns, clock, unit, notes)
    keys, row, column = _places(table, unit)
    wheels = tuple(names[int(k)] for k in np.unique(table[unit]))
    shape = (len(keys), len(wheels))
    _check_shape(shape, len(row), unit, named=unit in columns)
    channels = {
        name: _arranged(values, row, column, shape) for name, values in table.items() if name not in {TIME, unit, RUN}
    }
    _note_duplicates(row, column, shape, unit, notes)
    run, time_s = keys[:, 0].astype(np.int64), keys[:, 1]
    for number in np.unique(run):
        time_s[run == number] -= time_s[run == number][0]
    _check_step(time_s, run, notes)
    _note_gaps(time_s, run, notes)
    _note_channels(channels, wheels, unit, notes)
    if clock != TIME:
        channels[clock] = np.repeat(time_s[:, None] / TIME_UNITS_S[clock], len(wheels), axis=1)
    return Recording(time_s, run, wheels, channels, tuple(notes))


def _table(
    columns: Mapping[str, Column], clock: str, unit: str, notes: list[str]
) -> tuple[tuple[int | str, ...], dict[str, Array]]:
    """Return the wheels' names, and the rows that have time and wheel as numbers, each with its run."""
    given = {str(name): np.asarray(values) for name, values in columns.items()}
    if clock not in given:
        times = [name for name in given if name.lower().startswith(TIME_LIKE)]
        cure = f"; if {times[0]} is the time in seconds, name it {TIME}" if times else ""
        raise RecordingError(
            f"there is no column of time ({', '.join(TIME_UNITS_S)}); the table has {listed(given)}{cure}"
        )
    rows = given[clock].shape[0] if given[clock].ndim else 0
    for name, values in given.items():
        if values.shape != (rows,):
            raise RecordingError(f"column {name} has shape {values.shape}; one value for each row is needed, ({rows},)")
    if clock != TIME:
        given[TIME] = TIME_UNITS_S[clock] * _numbers(clock, given.pop(clock))
    names, place = _parts(given.pop(unit, np.ones(rows)))
    table = {name: _numbers(name, values) for name, values in given.items()} | {unit: place}
    table[RUN] = _numbered(table[RUN]) if RUN in table else np.zeros(rows)
    table[TIME] = np.where(np.isfinite(table[TIME]), table[TIME], np.nan)
    _check_span(table[TIME])
    table[RUN] = _split_where_the_clock_jumps_back(table, unit, notes)
    known = np.isfinite(table[TIME]) & np.isfinite(table[unit]) & np.isfinite(table[RUN])
    if not known.any():
        raise RecordingError(f"no row has both {TIME} and {unit}" if rows else "the recording has no rows")
    if not known.all():
        notes.append(f"{counted(int(np.sum(~known)), 'row')} without {TIME} or {unit}: left out.")
        table = {name: values[known] for name, values in table.items()}
    for name in table.keys() - {TIME, RUN, unit}:
        table[name] = _without_codes(name, table[name], notes)
    return names, table


def _numbered(run: Array) -> Array:
    """Return runs as whole numbers, NaN where there is none: as given, or counted where the column holds others."""
    known = np.isfinite(run)
    if np.all(run[known] == np.round(run[known])) and np.all(np.abs(run[known]) < MOST_RUNS):
        return run
    numbers = np.full(len(run), np.nan)
    numbers[known] = np.unique(run[known], return_inverse=True)[1]
    return numbers


def _check_span(time_s: Array) -> None:
    known = time_s[np.isfinite(time_s)]
    if not known.size:
        return
    if np.max(known) / 2 - np.min(known) / 2 > LONGEST_SPAN_S / 2 or np.max(np.abs(known)) > LATEST_S:
        latest = int(np.flatnonzero(time_s == np.max(known))[0])
        raise RecordingError(
            f"the time reaches from {np.min(known):g} to {np.max(known):g} s (row {latest + 1}): these are no "
            f"seconds. Name the column after its unit ({', '.join(TIME_UNITS_S)}), and correct single wrong times."
        )


def _check_shape(shape: tuple[int, int], rows: int, unit: str, *, named: bool) -> None:
    if shape[0] < 2:
        raise RecordingError(f"the recording has only one instant: all its times {TIME} are the same")
    if not named and rows > MOST_ROWS_PER_INSTANT * shape[0]:
        raise RecordingError(
            f"there are {rows} rows at {shape[0]} instants and no column {unit} that tells them apart; name the column "
            "that does, as `wheel_column` of the simulation. Of one machine with a coarse clock, write times that "
            "differ from row to row"
        )
    if shape[0] * shape[1] > MOST_PLACES_PER_ROW * rows:
        raise RecordingError(
            f"column {unit} has {shape[1]} different values in {rows} rows at {shape[0]} instants; it must name the "
            "wheel (axis, body) that a row belongs to"
        )


def _check_step(time_s: Array, run: Index, notes: list[str]) -> None:
    steps = np.diff(time_s)[np.diff(run) == 0]
    usual = float(np.median(steps)) if steps.size else 1.0
    if usual < SHORTEST_STEP_S:
        raise RecordingError(
            f"the time advances by {usual:g} s from one instant to the next. Name the column after its unit: "
            f"{', '.join(TIME_UNITS_S)}."
        )
    if usual > LONGEST_STEP_S:
        notes.append(
            f"The time advances by {usual:g} s from one instant to the next. If it is in milliseconds, call it t_ms."
        )


def _without_codes(name: str, values: Array, notes: list[str]) -> Array:
    """Return readings with NaN for what no sensor measures, and 0 for what is too small to compute with."""
    values = np.where(np.abs(values) < LEAST_READING, 0.0, values)
    code = np.abs(values) > GREATEST_READING
    if not code.any():
        return values
    notes.append(
        f"{counted(int(code.sum()), 'reading')} of {name} infinite or beyond {GREATEST_READING:g}: not measured."
    )
    return np.where(code, np.nan, values)


def _parts(values: NDArray[Any]) -> tuple[tuple[int | str, ...], Array]:
    """Return the names of wheels (axes, bodies) in ascending order, and each row's place among them; NaN: no name."""
    if values.dtype.kind in "iuf":
        known = np.isfinite(values.astype(np.float64))
        found, place = np.unique(values[known].astype(np.float64), return_inverse=True)
        names: tuple[int | str, ...] = tuple(int(name) if name == int(name) else str(name) for name in found)
    else:
        text = np.array(["" if value is None else str(value) for value in values])
        known = text != ""
        found, place = np.unique(text[known], return_inverse=True)
        names = tuple(str(name) for name in found)
    places = np.full(len(values), np.nan)
    places[known] = place
    return names, places


def _numbers(name: str, values: NDArray[Any]) -> Array:
    try:
        return values.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise RecordingError(f"column {name} must hold numbers: {error}") from error


def _places(table: Mapping[str, Array], unit: str) -> tuple[Array, Index, Index]:
    """Return the instants in order (run, time), each row's instant, and each row's wheel."""
    stamps = np.column_stack((table[RUN], np.round(table[TIME], TIME_DECIMALS)))
    by_time = np.lexsort(stamps.T[::-1])  # quick, where rows are in that order already
    ordered = stamps[by_time]
    begins = np.append(True, np.any(ordered[1:] != ordered[:-1], axis=1))[: len(stamps)]
    row = np.empty(len(stamps), np.int64)
    row[by_time] = np.cumsum(begins) - 1
    _, column = np.unique(table[unit], return_inverse=True)
    return ordered[begins], row, column.ravel().astype(np.int64)


def _arranged(values: Array, row: Index, column: Index, shape: tuple[int, int]) -> Array:
    """Return values as (time, wheel), NaN where there is none; rows of one instant and wheel are averaged."""
    place = row * shape[1] + column
    known = np.isfinite(values)
    total = np.bincount(place[known], values[known], minlength=shape[0] * shape[1])
    count = np.bincount(place[known], minlength=shape[0] * shape[1])
    return np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0).reshape(shape)


def _split_where_the_clock_jumps_back(table: Mapping[str, Array], unit: str, notes: list[str]) -> Array:
    """Return each row's run; a clock that jumps back a few times begins a new run each time."""
    run = table[RUN].copy()
    jumps, at = 0, 0.0
    shift = np.zeros(len(run))
    for name in np.unique(table[unit][np.isfinite(table[unit])]):
        here = np.flatnonzero(table[unit] == name)
        back = (np.diff(table[TIME][here]) < 0) & (np.diff(run[here]) == 0)
        if np.any(back):
            jumps, at = max(jumps, int(back.sum())), float(table[TIME][here][:-1][back][0])
            shift[here[1:]] = np.cumsum(back)
    if jumps == 0:
        return run
    if jumps > MOST_CLOCK_JUMPS:
        notes.append("Rows are not in the order of time; they are sorted.")
        return run
    notes.append(
        f"The clock jumps back {counted(jumps, 'time')}, first at {at:.1f} s; what follows is taken as another run."
    )
    return run * (MOST_CLOCK_JUMPS + 1) + shift


def _note_duplicates(row: Index, column: Index, shape: tuple[int, int], unit: str, notes: list[str]) -> None:
    taken = np.bincount(row * shape[1] + column, minlength=shape[0] * shape[1])
    if (extra := int(np.sum(taken[taken > 1] - 1))) > 0:
        notes.append(f"{counted(extra, 'row')} with the same {TIME} and {unit} as another: the mean is taken.")
    if (absent := int(np.sum(taken == 0))) > 0:
        notes.append(f"Instants without a row, counted for each {unit}: {absent} of {taken.size}.")


def gaps_in(time_s: Array, run: Index) -> Index:
    """Return the last row before each gap: a step within a run that is longer than `GAP_STEPS` usual ones."""
    steps = np.where(np.diff(run) == 0, np.diff(time_s), np.nan)
    usual = np.nanmedian(steps) if np.isfinite(steps).any() else np.nan
    return np.flatnonzero(steps > GAP_STEPS * usual)


def _note_gaps(time_s: Array, run: Index, notes: list[str]) -> None:
    gaps = gaps_in(time_s, run)
    if gaps.size:
        lost = float(np.sum(np.diff(time_s)[gaps]))
        notes.append(
            f"{counted(gaps.size, 'gap')}, {lost:.1f} s in all; nothing is assumed about what happened in between."
        )


def _note_channels(channels: Mapping[str, Array], wheels: tuple[int | str, ...], unit: str, notes: list[str]) -> None:
    for name, values in channels.items():
        known = np.isfinite(values)
        if not known.any():
            notes.append(f"{name} was never measured.")
            continue
        silent = [wheel for k, wheel in enumerate(wheels) if not known[:, k].any()]
        if silent:
            notes.append(f"{name} was never measured at {unit} {', '.join(map(str, silent))}.")
        if np.nanmax(values) == np.nanmin(values):
            notes.append(f"{told_constant(name)} ({np.nanmax(values):g}): nothing that depends on it can show.")
