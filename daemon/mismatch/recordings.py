"""Recordings of the command line: CSV, Parquet, or MCAP of the daemon, put together as runs of one recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.data.joined import joined
from regolithd.calibration.mismatch.data.recording import Recording, from_columns, read_recording
from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.daemon.recording.export import HEADER, recorded_snapshots, rows
from regolithd.daemon.recording.mcap_file import DamagedRecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


def read_recordings(paths: Sequence[Path], unit: str) -> Recording:
    """Read files of any kind; each is a run of its own. `unit` is the column that tells wheels (axes) apart.

    Raises
    ------
    RecordingError
        When a file is damaged, or they have no column in common; the message names the file.
    """
    return joined([read_one(path, unit) for path in paths], [path.name for path in paths])


def read_one(path: Path, unit: str, rover: str | None = None, rows: tuple[int, int] | None = None) -> Recording:
    """Read a file of any kind; of one that holds several rovers, the rows of one; `rows` of a Parquet file alone.

    Raises
    ------
    RecordingError
        When it is damaged, or no recording.
    """
    return _read_mcap(path) if path.suffix == ".mcap" else read_recording(path, unit=unit, rover=rover, rows=rows)


def _read_mcap(path: Path) -> Recording:
    if not path.is_file():
        raise RecordingError(f"{path} is not there" if not path.exists() else f"{path} is not a file")
    try:
        table = np.array(list(rows(recorded_snapshots([path]))), np.float64).reshape(-1, len(HEADER))
    except DamagedRecordingError as error:
        raise RecordingError(f"{error} `regolithd export` writes what can be read.") from error
    except Exception as error:  # snapshots of another program: their content may be anything
        told = f"{type(error).__name__}: {error}"[:200]
        raise RecordingError(f"{path} is no recording of `regolithd run` ({told})") from error
    if not len(table):
        raise RecordingError(f"{path} has no snapshots: it was closed at once, or is no recording of `regolithd run`")
    try:
        return from_columns(dict(zip(HEADER, table.T, strict=True)))
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from error
