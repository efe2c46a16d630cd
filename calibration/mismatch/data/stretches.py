"""A long recording in a Parquet file, compared stretch by stretch: memory holds one of them at a time.

Arrays of a comparison are a hundred times as large as the recording, and sums of products add up: so the stretches are
compared as the recordings of a fleet are, each by itself and all together, on all cores.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from regolithd.calibration.mismatch.data.columns import ROWS_AT_ONCE, as_numbers, parquet_errors, return_memory
from regolithd.calibration.mismatch.data.recording import RUN, TIME_UNITS_S

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

LONGEST_AT_ONCE = 400_000
"""Rows up to which a recording is compared at once (a choice: it then needs less than 1 GiB)."""
STRETCH = 100_000
"""Rows of a stretch, about (a choice: shorter ones cost more for each row, longer ones more memory)."""


@dataclass(frozen=True)
class Stretch:
    """Rows of a file, from the first to before the last, and the time since its beginning [s]."""

    first: int
    last: int
    from_s: float
    to_s: float

    @property
    def words(self) -> str:
        """The time as text: "1 h 30 min to 2 h 0 min"."""
        return f"{_in_words(self.from_s)} to {_in_words(self.to_s)}"


def _in_words(seconds: float) -> str:
    minutes, left = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {left} s"
    return f"{minutes // 60} h {minutes % 60} min"


def rows_in(path: Path) -> int:
    """Return the number of rows of a Parquet file, by its metadata; 0 of any other file.

    Raises
    ------
    RecordingError
        When it is damaged.
    """
    if path.suffix != ".parquet":
        return 0
    import pyarrow.parquet  # noqa: PLC0415

    with parquet_errors(path):
        return int(pyarrow.parquet.ParquetFile(path).metadata.num_rows)


def stretches_of(path: Path, rows: int = STRETCH) -> tuple[Stretch, ...]:
    """Return stretches of about so many rows, which begin with an instant; none where rows are not in order.

    Rows are in order where the time does not fall but from one run to the next: then all wheels of an instant follow
    each other.

    Raises
    ------
    RecordingError
        When the file is damaged.
    """
    state = path.stat()
    return _stretches(path, rows, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=64)
def _stretches(path: Path, rows: int, _changed_ns: int, _bytes: int) -> tuple[Stretch, ...]:
    """Return the stretches of a file in this state: it is asked for them twice, and reading all times takes a while."""
    total = rows_in(path)
    length = total / max(round(total / rows), 1)
    cuts, row, elapsed_s = [(0, 0.0)], 0, 0.0
    for steps, new_run in _steps(path):
        if np.any((steps < 0) & ~new_run):
            return ()
        since = elapsed_s + np.cumsum(np.where(new_run, 0.0, np.nan_to_num(steps)))
        begins = np.flatnonzero((steps != 0) | new_run)
        while (at := begins[begins + row >= cuts[-1][0] + length]).size:
            cuts.append((int(at[0]) + row, float(since[at[0]])))
        row, elapsed_s = row + len(steps), float(since[-1]) if len(since) else elapsed_s
    if len(cuts) > 1 and total - cuts[-1][0] < length / 2:
        cuts.pop()
    return_memory()
    ends = [*cuts[1:], (total, elapsed_s)]
    return tuple(Stretch(a, b, from_s, to_s) for (a, from_s), (b, to_s) in zip(cuts, ends, strict=True))


def _steps(path: Path) -> Iterator[tuple[NDArray[np.float64], NDArray[np.bool_]]]:
    """Yield the step of time [s] before each row, and whether a run begins with it; nothing where there is no time."""
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet  # noqa: PLC0415

    with parquet_errors(path):
        file = pyarrow.parquet.ParquetFile(path)
        clock = next((name for name in TIME_UNITS_S if name in file.schema_arrow.names), None)
        names = [name for name in (clock, RUN) if name in file.schema_arrow.names]
        before: NDArray[np.float64] | None = None
        for batch in file.iter_batches(ROWS_AT_ONCE, columns=names) if clock else ():
            columns = pa.Table.from_batches([batch])
            now = np.stack([_numbers(columns.column(name)) for name in names], axis=1)
            steps = np.diff(now, axis=0, prepend=now[:1] if before is None else before)
            before = now[-1:]
            yield steps[:, 0] * TIME_UNITS_S[str(clock)], np.any(steps[:, 1:] != 0, axis=1)


def _numbers(column: Any) -> NDArray[np.float64]:  # noqa: ANN401  # pyarrow has no types
    values = as_numbers(column)
    return np.asarray(column.to_numpy(), np.float64) if values is None else values
