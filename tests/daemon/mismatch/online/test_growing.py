"""Recordings are read while they are written: nothing twice, nothing lost, half a line or chunk waits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.daemon.mismatch.online.growing import Growing, growing
from regolithd.daemon.pipeline.snapshot import WHEELS, Snapshot
from regolithd.daemon.recording.content import SNAPSHOT, snapshot_json
from regolithd.daemon.recording.mcap_file import McapFile
from regolithd.drivers.devices.registry import QUANTITIES

if TYPE_CHECKING:
    from pathlib import Path

SECOND = 1_000_000_000


def nothing(text: str) -> None:
    """Fail: nothing is damaged here."""
    raise AssertionError(text)


def times(source: Growing) -> list[float]:
    """Return the times of the first wheel's rows that have come."""
    batches = [rows["t_s"][rows["wheel"] == 1] for rows in source.read()]
    return [float(t) for batch in batches for t in batch]


def write(file: McapFile, first: int, last: int) -> None:
    """Append a snapshot for each second from `first` up to, not including, `last`."""
    for second in range(first, last):
        values = np.full((len(QUANTITIES), WHEELS), float(second))
        file.write(SNAPSHOT, second * SECOND, snapshot_json(Snapshot(second, second * SECOND, values)), second)
    file.flush()


def test_an_mcap_file_is_read_as_it_grows(tmp_path: Path) -> None:
    """Each snapshot once, with its time from the first one, and the end when the daemon closes the file."""
    path = tmp_path / "rover-20260101T000000Z-000001.mcap"
    file = McapFile(path.open("xb"), {})
    file.flush()
    source = growing(path, "wheel", nothing)
    assert times(source) == []
    write(file, 100, 103)
    assert times(source) == [0.0, 1.0, 2.0]
    assert times(source) == []
    write(file, 103, 105)
    assert times(source) == [3.0, 4.0]
    assert not source.ended
    file.close()
    assert times(source) == []
    assert source.ended


def test_half_a_chunk_waits_for_the_rest(tmp_path: Path) -> None:
    """A file that is cut off anywhere gives its complete chunks, and the others when they are complete."""
    whole = tmp_path / "whole.mcap"
    file = McapFile(whole.open("xb"), {})
    write(file, 0, 3)
    write(file, 3, 6)
    file.close()
    content = whole.read_bytes()
    path = tmp_path / "part.mcap"
    for cut in range(4, len(content), 61):
        path.write_bytes(content[:cut])
        source = growing(path, "wheel", nothing)
        found = times(source)
        path.write_bytes(content)
        assert found + times(source) == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_a_folder_is_followed_from_file_to_file(tmp_path: Path) -> None:
    """The latest file first, then those that the daemon begins, in the order of their numbers, with one clock."""
    stem = "rover-20260101T00000{}Z-00000{}.mcap"
    first = McapFile((tmp_path / stem.format(9, 1)).open("xb"), {})
    write(first, 0, 2)
    first.close()
    second = McapFile((tmp_path / stem.format(5, 2)).open("xb"), {})
    write(second, 10, 12)
    source = growing(tmp_path, "wheel", nothing)
    assert times(source) == [0.0, 1.0]
    write(second, 12, 13)
    second.close()
    third = McapFile((tmp_path / stem.format(1, 3)).open("xb"), {})
    write(third, 20, 22)
    third.close()
    assert times(source) == [2.0, 10.0, 11.0]
    assert source.name == stem.format(1, 3)
    assert not source.ended


def test_a_csv_file_is_read_line_by_line(tmp_path: Path) -> None:
    """A line without its end waits; a blank is not measured; names of wheels may be text."""
    path = tmp_path / "bench.csv"
    path.write_text("t_s,wheel,curr")
    source = growing(path, "wheel", nothing)
    assert not list(source.read())
    path.write_text("t_s,wheel,current_A\n0,left,1.5\n0,right,\n1,left,2.")
    (rows,) = source.read()
    assert rows["wheel"].tolist() == ["left", "right"]
    np.testing.assert_array_equal(rows["current_A"], [1.5, np.nan])
    path.write_text("t_s,wheel,current_A\n0,left,1.5\n0,right,\n1,left,2.5\n")
    (rows,) = source.read()
    assert rows["current_A"].tolist() == [2.5]


def test_a_csv_file_that_is_renamed_is_read_to_its_end_and_then_the_new_one(tmp_path: Path) -> None:
    """Also while there is none of the name; the new one has its own header, and half a line at the end is dropped."""
    path, old, told = tmp_path / "bench.csv", tmp_path / "bench.csv.1", list[str]()
    path.write_text("t_s,wheel\n0,1\n1,1\n")
    source = growing(path, "wheel", told.append)
    assert times(source) == [0.0, 1.0]
    path.rename(old)
    with old.open("a") as file:
        file.write("2,1\n3,")
    assert times(source) == [2.0]
    path.write_text("wheel,t_s\n1,4\n")
    assert times(source) == [4.0]
    assert not source.ended
    assert [text.endswith("is followed from its start") for text in told] == [True]


def test_a_csv_file_that_is_emptied_is_read_from_its_start(tmp_path: Path) -> None:
    """A rotation that copies it away and goes on in the same file."""
    path, told = tmp_path / "bench.csv", list[str]()
    path.write_text("t_s,wheel\n0,1\n1,1\n")
    source = growing(path, "wheel", told.append)
    assert times(source) == [0.0, 1.0]
    path.write_text("t_s,wheel\n2,1\n")
    assert times(source) == [2.0]
    assert len(told) == 1


@pytest.mark.parametrize(("name", "said"), [("none.mcap", "is not there"), ("empty", "has no rover-")])
def test_what_cannot_be_followed_is_an_error(tmp_path: Path, name: str, said: str) -> None:
    """The message says what is missing."""
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=said):
        growing(tmp_path / name, "wheel", nothing)


def test_another_programs_mcap_is_an_error(tmp_path: Path) -> None:
    """A snapshot without its fields."""
    path = tmp_path / "other.mcap"
    file = McapFile(path.open("xb"), {})
    file.write(SNAPSHOT, 0, b"{}")
    file.close()
    with pytest.raises(RecordingError, match="no recording of `regolithd run`"):
        times(growing(path, "wheel", nothing))
