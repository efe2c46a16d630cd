"""Exports a recording as a table: one row per instant and wheel, blank where not measured, for `regolithd mismatch`."""

from __future__ import annotations

import csv
from typing import IO, TYPE_CHECKING

from regolithd.daemon.pipeline.snapshot import WHEELS
from regolithd.daemon.recording.content import SNAPSHOT, snapshot_from_json
from regolithd.daemon.recording.mcap_file import open_mcap, read_messages
from regolithd.daemon.recording.replacement import NO_ROW, ExportError, replacing
from regolithd.drivers.devices.registry import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path

    from regolithd.daemon.pipeline.snapshot import Snapshot

COLUMNS = tuple(quantity for quantity in QUANTITIES if not quantity.flags)
HEADER = ("t_s", "wheel", *(column.name for column in COLUMNS))

Row = tuple[float | int | None, ...]


def recorded_snapshots(
    recordings: Iterable[Path],
    opening: Callable[[Path], AbstractContextManager[IO[bytes]]] = open_mcap,
    on_gap: Callable[[str], None] | None = None,
) -> Iterator[Snapshot]:
    """Yield the snapshots of MCAP files, in their order; `on_gap` and errors are those of `read_messages`."""
    for recording in recordings:
        for message in read_messages(recording, opening, on_gap):
            if message.topic == SNAPSHOT:
                yield snapshot_from_json(message.content)


def rows(snapshots: Iterable[Snapshot]) -> Iterator[Row]:
    """Yield the rows: seconds from the first snapshot, wheel 1–6, then `COLUMNS`; None where not measured."""
    start: int | None = None
    for snapshot in snapshots:
        start = snapshot.time_ns if start is None else start
        t_s = (snapshot.time_ns - start) / 1e9
        columns = [snapshot[quantity].tolist() for quantity in COLUMNS]
        for wheel in range(WHEELS):
            values = (column[wheel] for column in columns)
            yield (t_s, wheel + 1, *(None if value != value else value for value in values))  # noqa: PLR0124  # NaN


def export(
    recordings: Iterable[Path],
    out: Path,
    opening: Callable[[Path], AbstractContextManager[IO[bytes]]] = open_mcap,
    on_gap: Callable[[str], None] | None = None,
) -> int:
    """Write `out`, CSV or Parquet by its name; return the number of rows. `opening` may show progress.

    Where this fails, a file that was there before stays as it was.

    Raises
    ------
    ExportError
        `out` has another suffix, pyarrow is missing, or the recordings hold no snapshot.
    DamagedRecordingError
        A recording is damaged, and there is no `on_gap`, which gets a text for everything that is left out.
    """
    write = {".csv": _write_csv, ".parquet": _write_parquet}.get(out.suffix)
    if write is None:
        raise ExportError(f"{out}: the suffix {out.suffix!r} is not supported. Name it .csv, .parquet or .nc.")
    with replacing(out) as beside:
        if not (count := write(rows(recorded_snapshots(recordings, opening, on_gap)), beside)):
            raise ExportError(NO_ROW.format(out))
    return count


def _write_csv(table: Iterator[Row], out: Path) -> int:
    count = 0
    with out.open("w", newline="", encoding="ascii") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(HEADER)
        for row in table:
            writer.writerow(row)
            count += 1
    return count


def _write_parquet(table: Iterator[Row], out: Path) -> int:
    try:
        import pyarrow as pa  # noqa: PLC0415  # the rover does not have it
        import pyarrow.parquet as pq  # noqa: PLC0415  # likewise
    except ImportError as error:
        raise ExportError(
            "Parquet needs pyarrow, which the rover does not have. "
            "`pip install 'regolithd[calibration]'`, or export to .csv."
        ) from error
    content = list(table)
    types = [pa.float64(), pa.int8(), *[pa.float64()] * len(COLUMNS)]
    columns = zip(*content, strict=True) if content else [()] * len(HEADER)
    arrays = [pa.array(column, kind) for column, kind in zip(columns, types, strict=True)]
    pq.write_table(pa.Table.from_arrays(arrays, names=list(HEADER)), str(out))
    return len(content)
