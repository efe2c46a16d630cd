"""A mistake in a table is one message with file, line and column; what can be read is read."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet
import pytest

from regolithd.calibration.mismatch.data.recording import Recording, as_recording, read_recording
from regolithd.calibration.mismatch.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

GOOD = "t_s,axis,force_N\n" + "".join(f"{k / 10},{axis},{k}\n" for k in range(5) for axis in ("elbow", "wrist"))


def read(folder: Path, content: str | bytes, name: str = "drive.csv") -> Recording:
    """Read a file with this content."""
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_recording(path, unit="axis")


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("", "drive.csv is empty"),
        (GOOD.replace("0.2,wrist,2", "0.2,wrist,two"), "drive.csv: line 7, column force_N: 'two' is not a number"),
        (GOOD.replace("0.2,wrist,2", "0.2,wrist"), "drive.csv, line 7: 2 cells, but 3 columns in the first line"),
        (GOOD.replace("0.2,wrist,2", "soon,wrist,2"), "drive.csv: line 7, column t_s: 'soon' is not a number"),
        (GOOD.replace("force_N", "t_s"), "drive.csv: more than one column is called t_s"),
        (GOOD.replace("t_s", "time"), "there is no column of time (t_s, t_ms"),
        (GOOD.replace(",", ";"), "drive.csv: columns are separated by ';'; write commas"),
        ("t_s;force_N\n0,0;1,5\n0,1;1,7\n", "drive.csv: columns are separated by ';'; write commas"),
        (GOOD.replace("t_s,axis", "t_s,joint"), "10 rows at 5 instants and no column axis"),
        (GOOD.encode("utf-16"), "drive.csv is UTF-16: save it as UTF-8"),
        (GOOD.replace("wrist", "Geländer", 1).encode("latin-1"), "line 3, character 8: this is not UTF-8"),
        (b"PAR1" + bytes(20), "drive.csv is a Parquet file: give it the ending .parquet"),
        (b"\x00\x01\x02" * 50, "drive.csv is no text"),
        ("t_s,axis,force_N\n", "drive.csv: the recording has no rows"),
        ("t_s,axis,force_N\n1,a,2\n1,b,2\n", "only one instant"),
        ("t_s,force_N\n2026-01-31 12:00:00,1\n2026-01-31 12:00:01,2\n", "column t_s holds timestamp[s]"),
        ("t_s,force_N\n" + "".join(f"{k}e-8,1\n" for k in range(9)), "advances by 1e-08 s"),
        ("t_s,force_N\n0,1\n1e12,2\n", "reaches from 0 to 1e+12 s (row 2)"),
    ],
)
def test_a_wrong_file_is_one_message(content: str | bytes, told: str, tmp_path: Path) -> None:
    """The message names the file, where it is wrong, and what to change."""
    with pytest.raises(RecordingError) as caught:
        read(tmp_path, content)
    assert told in str(caught.value)
    assert "drive.csv" in str(caught.value)


def test_a_file_that_is_cut_off_is_one_message(tmp_path: Path) -> None:
    """Half of a compressed file, or of a Parquet file, is refused."""
    with pytest.raises(RecordingError, match="cannot be decompressed"):
        read(tmp_path, gzip.compress(GOOD.encode())[:-20], "drive.csv.gz")
    pyarrow.parquet.write_table(pa.table({"t_s": [0.0, 1.0]}), tmp_path / "whole")
    with pytest.raises(RecordingError, match=r"not a whole Parquet file: Parquet magic bytes not found"):
        read(tmp_path, (tmp_path / "whole").read_bytes()[:-9], "drive.parquet")


def test_an_absent_file_is_one_message(tmp_path: Path) -> None:
    """The message says that it is not there."""
    with pytest.raises(RecordingError, match="is not there"):
        read_recording(tmp_path / "none.csv")


def test_a_column_of_text_is_not_read_and_remembered(tmp_path: Path) -> None:
    """A surface's name is no channel, and a simulation that needs the column is told why it is not there."""
    rows = "".join(f"{k},{'sand' if k % 3 else ''},1\n" for k in range(5))
    found = read(tmp_path, "t_s,surface,force_N\n" + rows)
    assert set(found.channels) == {"force_N"}
    assert found.unread == ("column surface holds text ('sand' in line 3), not numbers",)


def test_readings_that_are_codes_are_not_measured(tmp_path: Path) -> None:
    """Infinite and absurd readings are blank, and counted."""
    found = read(tmp_path, "t_s,force_N\n0,1\n1,inf\n2,9.97e36\n3,4\n")
    np.testing.assert_array_equal(found.channels["force_N"][:, 0], [1, np.nan, np.nan, 4])
    assert any("2 readings of force_N" in note for note in found.notes)


def test_a_slow_recording_is_taken_with_a_note(tmp_path: Path) -> None:
    """Steps of minutes are possible; milliseconds are suggested."""
    found = read(tmp_path, "t_s,force_N\n0,1\n200,2\n400,3\n")
    assert any("call it t_ms" in note for note in found.notes)


TABLE: dict[str, Any] = {"t_s": [0.0, 0.0, 0.1, 0.1], "axis": ["a", "b"] * 2, "force_N": [1, 2, 3, None]}


@pytest.mark.parametrize("frame", [pd.DataFrame(TABLE), pa.table(TABLE), {**TABLE, "force_N": [1.0, 2, 3, np.nan]}])
def test_a_data_frame_is_a_recording(frame: object) -> None:
    """Frames of pandas and pyarrow and mappings of arrays or lists give the same arrays."""
    found = as_recording(frame, unit="axis")
    assert found.wheels == ("a", "b")
    np.testing.assert_array_equal(found.channels["force_N"], [[1, 2], [3, np.nan]])
    assert as_recording(found) is found


@pytest.mark.parametrize(
    ("frame", "told"),
    [
        (3, "a int is no data frame"),
        ({"t_s": [0, 1], "force_N": [1]}, "one value for each row"),
        ({"t_s": [0, 1], "force_N": np.ones((2, 6))}, "one value for each row"),
        (pd.DataFrame({"t_s": [0, 1, 2], "force_N": ["1", "2", "x"]}), "row 3, column force_N: 'x'"),
    ],
)
def test_what_is_no_table_is_one_message(frame: object, told: str) -> None:
    """The message names the row and column where there is one."""
    with pytest.raises(RecordingError) as caught:
        as_recording(frame)
    assert told in str(caught.value)
