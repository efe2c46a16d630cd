"""Stretches of a long recording: whole instants, in the order of time, each read alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from regolithd.calibration.mismatch.data import stretches
from regolithd.calibration.mismatch.data.columns import rovers_in
from regolithd.calibration.mismatch.data.recording import read_recording
from regolithd.calibration.mismatch.data.stretches import Stretch, rows_in, stretches_of
from regolithd.calibration.mismatch.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

INSTANTS, WHEELS = 500, 2
TIME_S = 0.5 * np.arange(INSTANTS)


def table(**more: np.ndarray) -> dict[str, np.ndarray]:
    """Return a recording of two wheels, one row after the other as they were read."""
    rows = INSTANTS * WHEELS
    return {
        "t_s": np.repeat(TIME_S, WHEELS),
        "wheel": np.tile([1, 2], INSTANTS),
        "current_A": np.arange(float(rows)),
        **more,
    }


def written(folder: Path, columns: dict[str, np.ndarray], group: int = 300) -> Path:
    """Write a Parquet file in groups of so many rows."""
    path = folder / "long.parquet"
    pq.write_table(pa.table(columns), path, row_group_size=group)
    return path


@pytest.mark.parametrize("batch", [7, 64, 5000])
def test_stretches_hold_every_row_once_and_whole_instants(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int
) -> None:
    """However many rows are read at once."""
    monkeypatch.setattr(stretches, "ROWS_AT_ONCE", batch)
    path = written(tmp_path, table())
    found = stretches_of(path, 251)
    assert [(each.first, each.last) for each in found] == [(0, 250), (250, 500), (500, 750), (750, 1000)]
    assert [each.from_s for each in found] == [0.0, 62.5, 125.0, 187.5]
    read = [read_recording(path, rows=(each.first, each.last)) for each in found]
    currents = np.concatenate([each.channels["current_A"] for each in read])
    np.testing.assert_array_equal(currents.ravel(), np.arange(1000.0))
    assert all(each.shape == (125, 2) for each in read)


def test_a_stretch_is_cut_at_an_instant(tmp_path: Path) -> None:
    """No instant has one wheel in one stretch and the other in the next."""
    found = stretches_of(written(tmp_path, table()), 333)
    assert [each.first % WHEELS for each in found] == [0, 0, 0]
    assert found[-1].last == INSTANTS * WHEELS


def test_a_run_begins_anew_and_the_time_goes_on(tmp_path: Path) -> None:
    """Where a column of runs says so, the time may fall back."""
    time_s = np.repeat(np.concatenate((TIME_S[:250], TIME_S[:250])), WHEELS)
    runs = np.repeat([0, 1], INSTANTS)
    found = stretches_of(written(tmp_path, table(t_s=time_s, run=runs)), 500)
    assert [each.from_s for each in found] == [0.0, pytest.approx(124.5, abs=1)]
    assert stretches_of(written(tmp_path, table(t_s=time_s)), 500) == ()


def test_before_the_stretches_are_read_no_other_column_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory would hold the whole recording to see whose it is, and where it can be cut."""
    read: list[list[str]] = []
    iter_batches = pq.ParquetFile.iter_batches

    def watched(file: Any, *args: Any, columns: list[str], **options: Any) -> Any:
        read.append(columns)
        return iter_batches(file, *args, columns=columns, **options)

    def whole(*_: object) -> None:
        raise AssertionError("the whole file is read")

    monkeypatch.setattr(pq.ParquetFile, "iter_batches", watched)
    monkeypatch.setattr(pq.ParquetFile, "read", whole)
    path = written(tmp_path, table())
    assert rovers_in(path) == ()
    assert len(stretches_of(path, 500)) == 2
    named = written(tmp_path, table(rover=np.repeat(["b", "", "a"], [INSTANTS, 300, 200])))
    assert rovers_in(named) == ("a", "b")
    assert read == [["t_s"], ["rover"]]


def test_rows_wheel_by_wheel_have_no_stretches(tmp_path: Path) -> None:
    """A part of the rows would be a part of the wheels: such a file is read at once."""
    columns = {name: np.concatenate((values[::2], values[1::2])) for name, values in table().items()}
    assert stretches_of(written(tmp_path, columns), 500) == ()


def test_what_has_no_time_has_one_stretch(tmp_path: Path) -> None:
    """Reading it says what is wrong."""
    columns = table()
    del columns["t_s"]
    assert [(each.first, each.last) for each in stretches_of(written(tmp_path, columns), 200)] == [(0, 1000)]


def test_rows_are_counted_by_the_metadata(tmp_path: Path) -> None:
    """Of Parquet files; of others they are not known before they are read."""
    assert rows_in(written(tmp_path, table())) == 1000
    assert rows_in(tmp_path / "other.csv") == 0
    (tmp_path / "torn.parquet").write_bytes(b"PAR1 torn")
    with pytest.raises(RecordingError, match=r"torn.parquet is not a whole Parquet file"):
        rows_in(tmp_path / "torn.parquet")


def test_times_are_told_in_hours_and_minutes() -> None:
    """Short ones with seconds."""
    assert Stretch(0, 1, 90.0, 5400.4).words == "1 min 30 s to 1 h 30 min"
