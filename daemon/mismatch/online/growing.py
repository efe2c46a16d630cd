"""Recordings that are still being written: what has come since the last look, as columns of rows.

The daemon ends a chunk of its MCAP file twice a second, so that its rows are read a second late at most. Of a CSV file
only lines with an end are taken.
"""

from __future__ import annotations

import os
from io import BytesIO
from typing import TYPE_CHECKING, BinaryIO, Protocol

import numpy as np

from regolithd.calibration.mismatch.data.columns import file_columns, frame_columns
from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.daemon.recording.content import SNAPSHOT, snapshot_from_json
from regolithd.daemon.recording.export import HEADER, rows
from regolithd.daemon.recording.mcap_file import DamagedRecordingError, MessageReader

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from regolithd.calibration.mismatch.data.columns import Column
    from regolithd.daemon.pipeline.snapshot import Snapshot

Rows = dict[str, "Column"]

BATCH = 2000
"""Snapshots that are turned into rows at once."""
CSV_BATCH = 1 << 20
"""Bytes of a CSV file that are parsed at once."""


class Growing(Protocol):
    """A recording that grows."""

    @property
    def name(self) -> str:
        """The file that is read now."""

    @property
    def ended(self) -> bool:
        """Whether no more will come."""

    def read(self) -> Iterator[Rows]:
        """Yield what has come since the last call.

        Raises
        ------
        RecordingError
            It cannot be read.
        """


def growing(path: Path, unit: str, note: Callable[[str], None]) -> Growing:
    """Return a recording by its kind: the daemon's folder, MCAP, CSV, or a file that does not grow.

    Parameters
    ----------
    unit: the column that tells wheels apart
    note: called with a text for what is damaged and left out, and for a file that is begun anew

    Raises
    ------
    RecordingError
        It is not there.
    """
    if not path.exists():
        raise RecordingError(f"{path} is not there")
    if path.is_dir():
        return GrowingFolder(path, note)
    if path.suffix == ".mcap":
        return GrowingMcap(path, note)
    return GrowingCsv(path, unit, note) if path.suffix == ".csv" else WholeFile(path, unit)


class GrowingMcap:
    """The snapshots of one MCAP file of the daemon; `begun_ns` is the time that `t_s` counts from."""

    def __init__(self, path: Path, note: Callable[[str], None], begun_ns: int | None = None) -> None:
        self._path = path
        self._reader = MessageReader(path, on_gap=note)
        self.begun_ns = begun_ns

    @property
    def name(self) -> str:
        """The file's name."""
        return self._path.name

    @property
    def ended(self) -> bool:
        """Whether the daemon has closed the file."""
        return self._reader.ended

    def read(self) -> Iterator[Rows]:
        """Yield the rows of the snapshots that have come."""
        batch: list[Snapshot] = []
        try:
            for message in self._reader.messages():
                if message.topic == SNAPSHOT:
                    batch.append(snapshot_from_json(message.content))
                if len(batch) == BATCH:
                    yield self._rows(batch)
                    batch = []
        except (DamagedRecordingError, KeyError, TypeError, ValueError) as error:
            told = f"{type(error).__name__}: {error}"[:200]
            raise RecordingError(f"{self._path} is no recording of `regolithd run` ({told})") from error
        if batch:
            yield self._rows(batch)

    def _rows(self, batch: list[Snapshot]) -> Rows:
        if self.begun_ns is None:
            self.begun_ns = batch[0].time_ns
        table = np.array(list(rows(batch)), np.float64)
        table[:, 0] += (batch[0].time_ns - self.begun_ns) / 1e9
        return dict(zip(HEADER, table.T, strict=True))


class GrowingFolder:
    """The recordings of a running daemon: the latest file, and those that it begins afterwards."""

    def __init__(self, folder: Path, note: Callable[[str], None]) -> None:
        self._folder, self._note = folder, note
        files = self._files()
        if not files:
            raise RecordingError(f"{folder} has no rover-*.mcap: give the folder that `regolithd run` records to")
        self._path = files[-1]
        self._file = GrowingMcap(self._path, note)

    @property
    def name(self) -> str:
        """The name of the file that is read now."""
        return self._path.name

    @property
    def ended(self) -> bool:
        """A running daemon begins another file."""
        return False

    def read(self) -> Iterator[Rows]:
        """Yield what has come; where the file was closed, or was left for another, go on with that."""
        while True:
            following = [path for path in self._files() if _number(path) > _number(self._path)]
            yield from self._file.read()
            if not following:
                return
            self._path = following[0]
            self._file = GrowingMcap(self._path, self._note, self._file.begun_ns)

    def _files(self) -> list[Path]:
        return sorted(self._folder.glob("rover-*.mcap"), key=_number)


def _number(path: Path) -> tuple[int, str]:
    """Return a recording's place among others: the number at the end of its name rises, a clock may be set back."""
    number = path.stem.rpartition("-")[2]
    return (int(number) if number.isdecimal() else 0, path.name)


class GrowingCsv:
    """The complete lines of a CSV file, and of the one that takes its name when it is renamed or emptied.

    The old file is read to its end first, as `tail -F` does. The new one has a header of its own.
    """

    def __init__(self, path: Path, unit: str, note: Callable[[str], None]) -> None:
        self._path, self._unit, self._note = path, unit, note
        self._file: BinaryIO = path.open("rb")
        self._header = b""
        self._offset = 0

    def __del__(self) -> None:
        self._file.close()

    @property
    def name(self) -> str:
        """The file's name."""
        return self._path.name

    @property
    def ended(self) -> bool:
        """Whether a CSV file is complete cannot be seen."""
        return False

    def read(self) -> Iterator[Rows]:
        """Yield the rows of the lines that have come."""
        while True:
            following = self._following()
            while text := self._lines():
                if not self._header:
                    self._header, _, text = text.partition(b"\n")
                if text.strip():
                    yield self._parsed(text)
            if following is None:
                return
            self._go_on(following)

    def _following(self) -> BinaryIO | None:
        """Return the file that has the name now, where that is another one or was emptied; None: it is the same.

        Between its renaming and the new file there may be none.
        """
        try:
            file = self._path.open("rb")
        except FileNotFoundError:
            return None
        if os.path.sameopenfile(file.fileno(), self._file.fileno()) and self._offset <= os.fstat(file.fileno()).st_size:
            file.close()
            return None
        return file

    def _go_on(self, following: BinaryIO) -> None:
        self._note(f"{self._path} was begun anew; the new file is followed from its start")
        self._file.close()
        self._file, self._header, self._offset = following, b"", 0

    def _lines(self) -> bytes:
        self._file.seek(self._offset)
        text = self._file.read(CSV_BATCH)
        whole = text[: text.rfind(b"\n") + 1]
        self._offset += len(whole)
        return whole

    def _parsed(self, text: bytes) -> Rows:
        import pyarrow as pa  # noqa: PLC0415  # the daemon loads this module's neighbours without it
        import pyarrow.csv  # noqa: PLC0415  # likewise

        try:
            table = pyarrow.csv.read_csv(BytesIO(self._header + b"\n" + text))
        except (pa.ArrowException, ValueError) as error:
            raise RecordingError(f"{self._path}, before byte {self._offset}: {str(error).splitlines()[0]}") from error
        try:
            return frame_columns(table, self._unit).numbers
        except RecordingError as error:
            raise RecordingError(f"{self._path}: {error}") from error


class WholeFile:
    """A file that does not grow: Parquet, or compressed CSV."""

    def __init__(self, path: Path, unit: str) -> None:
        self._path, self._unit = path, unit
        self.ended = False

    @property
    def name(self) -> str:
        """The file's name."""
        return self._path.name

    def read(self) -> Iterator[Rows]:
        """Yield all rows, once."""
        if not self.ended:
            yield file_columns(self._path, self._unit).numbers
            self.ended = True
