"""One file of the store: duplicate descriptors, refused writes, and foreign files."""

import errno
import os
from pathlib import Path

import pytest

from regolithd.daemon.publish.segment import MAGIC, Segment, pack, unpack


def test_a_duplicate_descriptor_outlives_the_segments_own(tmp_path: Path) -> None:
    """A closed segment has no duplicate, but one made before stays open."""
    segment = Segment.create(tmp_path, 7)
    segment.append(pack("snapshot", b"{}"))
    duplicate = segment.duplicate()
    assert duplicate is not None
    segment.close()
    try:
        os.fsync(duplicate)
        assert os.fstat(duplicate).st_size == segment.size
    finally:
        os.close(duplicate)
    assert segment.duplicate() is None


@pytest.mark.parametrize("taken", [None, 5], ids=["refused", "cut short"])
def test_a_record_that_the_disk_does_not_take_whole_leaves_no_trace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken: int | None
) -> None:
    """The records before and after it are read."""
    segment = Segment.create(tmp_path, 0)
    segment.append(pack("event", b"first"))
    write = os.write

    def full(file: int, data: bytes) -> int:
        if taken is None:
            raise OSError(errno.ENOSPC, "no space")
        return write(file, data[:taken])

    with monkeypatch.context() as patched:
        patched.setattr("regolithd.daemon.publish.segment.os.write", full)
        with pytest.raises(OSError, match=r"no space|only a part"):
            segment.append(pack("event", b"second"))
    segment.append(pack("event", b"third"))
    segment.close()
    assert [(record.index, record.payload) for record in segment.read()] == [(0, b"first"), (1, b"third")]
    assert (segment.count, segment.end, segment.size) == (2, 2, segment.path.stat().st_size)


def test_a_file_that_is_not_a_segment_holds_no_records() -> None:
    """A file without the magic bytes gives no record."""
    data = MAGIC + pack("event", b"payload")
    assert [record.payload for record, _ in unpack(data, 0)] == [b"payload"]
    assert list(unpack(b"x" + data[1:], 0)) == []
