"""Recordings as arrays (time × wheel), with notes of what was wrong with the table.

The long table of the contract (one row per instant and wheel) becomes one array per channel. What is not measured is
NaN. Order of rows, origin of time and names of wheels carry no meaning: rows are sorted by run, time and wheel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Column = NDArray[Any]
"""Numbers; text in the column that tells wheels apart."""

TIME = "t_s"
TIME_UNITS_S = {"t_s": 1.0, "t_ms": 1e-3, "t_us": 1e-6, "t_ns": 1e-9, "t_min": 60.0, "t_h": 3600.0}
"""Names that the column of time may have, and their unit in seconds."""
UNIT = "wheel"
RUN = "run"
MOST_CLOCK_JUMPS = 3
"""Backward jumps of the clock up to which each begins a new run; more are rows out of order (a choice)."""
GAP_STEPS = 5
"""Steps of time longer than so many usual ones are noted as gaps (a choice)."""
TIME_DECIMALS = 9
"""Times that agree to a nanosecond are one instant: less is rounding of the text."""


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
    """

    time_s: Array
    run: NDArray[np.int64]
    wheels: tuple[int | str, ...]
    channels: Mapping[str, Array]
    notes: tuple[str, ...] = ()

    @property
    def shape(self) -> tuple[int, int]:
        """(time, wheel)."""
        return len(self.time_s), len(self.wheels)

    @property
    def step_s(self) -> float:
        """The usual time from one instant to the next [s]."""
        steps = np.diff(self.time_s)[np.diff(self.run) == 0]
        return float(np.median(steps)) if steps.size else 1.0

    def channel(self, name: str) -> Array:
        """Return a channel, or NaN everywhere where it was not recorded."""
        found = self.channels.get(name)
        return np.full(self.shape, np.nan) if found is None else found

    def with_notes(self, *notes: str) -> Recording:
        """Return the recording with further notes."""
        return replace(self, notes=(*self.notes, *notes))

    def with_channels(self, **channels: Array) -> Recording:
        """Return the recording with channels added or replaced (derived ones, say)."""
        return replace(self, channels={**self.channels, **channels})


def read_recording(path: Path, *, unit: str = UNIT) -> Recording:
    """Read CSV (also .gz) or Parquet.

    Raises
    ------
    RecordingError
        When the file is none of these, or has no time.
    """
    columns = _read_parquet(path, unit) if path.suffix == ".parquet" else _read_csv(path, unit)
    return from_columns(columns, unit=unit)


def _read_csv(path: Path, unit: str) -> dict[str, Column]:
    import pyarrow.csv  # noqa: PLC0415  # only files need it; arrays do not
    from pyarrow import ArrowException  # noqa: PLC0415

    try:
        table = pyarrow.csv.read_csv(path)
    except (ArrowException, OSError) as error:
        raise RecordingError(f"{path} is not a table that can be read: {error}") from error
    return _as_columns(table, path, unit)


def _read_parquet(path: Path, unit: str) -> dict[str, Column]:
    import pyarrow.parquet  # noqa: PLC0415
    from pyarrow import ArrowException  # noqa: PLC0415

    try:
        table = pyarrow.parquet.read_table(path)
    except (ArrowException, OSError) as error:
        raise RecordingError(f"{path} is not a Parquet file that can be read: {error}") from error
    return _as_columns(table, path, unit)


def _as_columns(table: object, path: Path, unit: str) -> dict[str, Column]:
    """Return the columns that are numbers, and the one that tells the machine's parts apart, which may be text.

    A column of text that is mostly numbers is a column with a cell gone wrong: that is said, with the first such cell.
    """
    import pyarrow as pa  # noqa: PLC0415

    columns: dict[str, Column] = {}
    for name in table.column_names:  # type: ignore[attr-defined]
        column = table.column(name)  # type: ignore[attr-defined]
        kind = column.type
        if pa.types.is_null(kind):
            columns[name] = np.full(len(column), np.nan)
        elif pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
            columns[name] = column.cast(pa.float64()).to_numpy(zero_copy_only=False).astype(np.float64)
        elif name == unit and (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
            columns[name] = np.array([value or "" for value in column.to_pylist()])
        elif (wrong := _cell_gone_wrong(column.to_pylist(), everywhere=name in {*TIME_UNITS_S, RUN})) is not None:
            row, text = wrong
            raise RecordingError(
                f"{path}: column {name}, row {row + 2}: {text!r} is not a number. Leave a cell empty where nothing was "
                "measured."
            )
    return columns


def _cell_gone_wrong(cells: Sequence[object], *, everywhere: bool) -> tuple[int, object] | None:
    """Return place and text of the first cell that is not a number in a column of which at least half are numbers."""
    wrong = [(row, cell) for row, cell in enumerate(cells) if cell is not None and not _is_number(cell)]
    if not wrong or not (everywhere or len(wrong) <= len(cells) / 2):
        return None
    return wrong[0]


def _is_number(cell: object) -> bool:
    try:
        float(str(cell))
    except ValueError:
        return False
    return True


def from_columns(columns: Mapping[str, Column], *, unit: str = UNIT) -> Recording:
    """Arrange a long table's columns (a mapping of arrays, or a data frame) as arrays (time × wheel).

    Raises
    ------
    RecordingError
        When there is no time, or fewer than two instants.
    """
    given = {str(name): np.asarray(values) for name, values in columns.items()}
    clock = next((name for name in TIME_UNITS_S if name in given), None)
    if clock is None:
        raise RecordingError(
            f"there is no column of time ({', '.join(TIME_UNITS_S)}); found {', '.join(given) or 'nothing'}"
        )
    notes: list[str] = []
    if clock != TIME:
        given[TIME] = TIME_UNITS_S[clock] * _numbers(clock, given.pop(clock))
    names, place = _parts(given.pop(unit, np.ones(len(given[TIME]))))
    table = {name: _numbers(name, values) for name, values in given.items()} | {unit: place}
    rows = len(table[TIME])
    table.setdefault(RUN, np.zeros(rows))
    table[RUN] = _split_where_the_clock_jumps_back(table, unit, notes)
    known = np.isfinite(table[TIME]) & np.isfinite(table[unit]) & np.isfinite(table[RUN])
    if not known.all():
        notes.append(f"{np.sum(~known)} rows have no time or no {unit}; they are left out.")
        table = {name: values[known] for name, values in table.items()}
    if not len(table[TIME]):
        raise RecordingError("the recording has no rows")
    keys, row, column = _places(table, unit)
    wheels = tuple(names[int(k)] for k in np.unique(table[unit]))
    shape = (len(keys), len(wheels))
    if shape[0] < 2:
        raise RecordingError("the recording has only one instant")
    channels = {
        name: _arranged(values, row, column, shape) for name, values in table.items() if name not in {TIME, unit, RUN}
    }
    _note_duplicates(row, column, shape, notes)
    run, time_s = keys[:, 0].astype(np.int64), keys[:, 1]
    for number in np.unique(run):
        time_s[run == number] -= time_s[run == number][0]
    _note_gaps(time_s, run, notes)
    _note_channels(channels, wheels, unit, notes)
    if clock != TIME:
        channels[clock] = np.repeat(time_s[:, None] / TIME_UNITS_S[clock], len(wheels), axis=1)
    return Recording(time_s, run, wheels, channels, tuple(notes))


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
    keys, row = np.unique(stamps, axis=0, return_inverse=True)
    _, column = np.unique(table[unit], return_inverse=True)
    return keys, row.ravel().astype(np.int64), column.ravel().astype(np.int64)


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
    notes.append(f"The clock jumps back {jumps} time(s), first at {at:.1f} s; what follows is taken as another run.")
    return run * (MOST_CLOCK_JUMPS + 1) + shift


def _note_duplicates(row: Index, column: Index, shape: tuple[int, int], notes: list[str]) -> None:
    taken = np.bincount(row * shape[1] + column, minlength=shape[0] * shape[1])
    if (extra := int(np.sum(taken[taken > 1] - 1))) > 0:
        notes.append(f"{extra} rows repeat an instant and wheel; their mean is taken.")
    if (absent := int(np.sum(taken == 0))) > 0:
        notes.append(f"{absent} of {taken.size} instants of single wheels are absent.")


def _note_gaps(time_s: Array, run: Index, notes: list[str]) -> None:
    steps = np.where(np.diff(run) == 0, np.diff(time_s), np.nan)
    usual = np.nanmedian(steps) if np.isfinite(steps).any() else np.nan
    gaps = np.flatnonzero(steps > GAP_STEPS * usual)
    if gaps.size:
        lost = float(np.sum(steps[gaps]))
        notes.append(f"{gaps.size} gaps, {lost:.1f} s in all; nothing is assumed about what happened in them.")


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
            notes.append(f"{name} is constant ({np.nanmax(values):g}): nothing that depends on it can show.")
