"""One file of the store: duplicate descriptors, refused writes, damage, and foreign files."""

import errno
import os
import struct
import zlib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regolithd.daemon.publish.segment import Segment
from regolithd.daemon.publish.segment_format import MAGIC, pack, unpack
from regolithd.daemon.publish.segment_record import SegmentContents

MESSAGES = [
    ("snapshot", b'{"schema_version":2,"late":false,"sequence":7}'),
    ("node/13", b"{}"),
    ("event", b'{"text":"\xc3\xa4 { }"}'),
    ("alarm/bus", b'{"schema_version":2}'),
]


def test_a_duplicate_descriptor_outlives_the_segments_own(tmp_path: Path) -> None:
    """A closed segment has no duplicate, but one made before stays open."""
    segment = Segment.create(tmp_path, 7)
    segment.append(pack(7, "snapshot", b"{}"))
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
    segment.append(pack(0, "event", b"first"))
    write = os.write

    def full(file: int, data: bytes) -> int:
        if taken is None:
            raise OSError(errno.ENOSPC, "no space")
        return write(file, data[:taken])

    with monkeypatch.context() as patched:
        patched.setattr("regolithd.daemon.publish.segment.os.write", full)
        with pytest.raises(OSError, match=r"no space|only a part"):
            segment.append(pack(1, "event", b"second"))
    segment.append(pack(1, "event", b"third"))
    segment.close()
    assert [(record.index, record.payload) for record in segment.read()] == [(0, b"first"), (1, b"third")]
    assert (segment.count, segment.end, segment.size) == (2, 2, segment.path.stat().st_size)


def written(first: int = 5) -> bytes:
    """Return a segment with `MESSAGES`, in the current format."""
    return MAGIC + b"".join(pack(first + k, *message) for k, message in enumerate(MESSAGES))


def written_by_version_0_1() -> bytes:
    """Return a segment with `MESSAGES`, in the format of version 0.1."""
    records = b""
    for topic, payload in MESSAGES:
        body = topic.encode() + payload
        records += struct.pack("<IIH", len(body), zlib.crc32(body), len(topic)) + body
    return b"regspl1\n" + records


def messages(contents: SegmentContents) -> list[tuple[str, bytes]]:
    """Return topic and payload of each valid record."""
    return [(record.topic, record.payload) for record in contents.records]


@pytest.mark.parametrize("data", [written(), written_by_version_0_1()], ids=["current", "0.1"])
def test_a_whole_segment_gives_all_its_records(data: bytes) -> None:
    """Files of version 0.1 are read as those of this version."""
    contents = unpack(data, 5)
    assert messages(contents) == MESSAGES
    assert [record.index for record in contents.records] == [5, 6, 7, 8]
    assert (contents.end, contents.damaged, contents.torn) == (9, 0, False)


@pytest.mark.parametrize(
    ("rest", "torn"),
    [
        (b"\x07", True),
        (bytes(40), True),
        (struct.pack("<IIH", 90, 0, 5) + b"event{", True),
        (struct.pack("<IIH", 4, 0, 1) + b"e{}!", False),
    ],
    ids=["part of a head", "zeros", "part of a record", "a wrong checksum"],
)
def test_what_a_power_cut_left_of_version_0_1_is_no_damage(rest: bytes, torn: bool) -> None:
    """The records before it are read; its place is where the next one is written."""
    contents = unpack(written_by_version_0_1() + rest, 5)
    assert messages(contents) == MESSAGES
    assert (contents.torn, contents.damaged) == (torn, not torn)


def test_a_copy_of_an_earlier_record_is_passed_over() -> None:
    """What a write that was repeated has left; the records behind it are delivered, and none is counted as damaged."""
    records = [pack(5 + k, *message) for k, message in enumerate(MESSAGES)]
    contents = unpack(MAGIC + records[0] + records[1] + records[0] + records[2] + records[3], 5)
    assert messages(contents) == MESSAGES
    assert (contents.end, contents.damaged, contents.torn) == (9, 0, False)


def test_any_flipped_bit_costs_one_record_at_most() -> None:
    """All others are delivered unaltered with their indices, and the lost one is counted."""
    data = written()
    for bit in range(8 * len(data)):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        contents = unpack(bytes(flipped), 5)
        assert all(MESSAGES[record.index - 5] == (record.topic, record.payload) for record in contents.records), bit
        assert contents.damaged == (bit >= 8 * len(MAGIC)), bit
        assert len(contents.records) + contents.damaged == len(MESSAGES), bit
        assert (contents.end, contents.torn) == (9, False), bit


def test_any_flipped_bit_in_a_segment_of_version_0_1_costs_one_record_at_most() -> None:
    """A flipped topic length costs nothing, since it is not used."""
    data = written_by_version_0_1()
    for bit in range(8 * len(data)):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        contents = unpack(bytes(flipped), 5)
        found = messages(contents)
        assert [message for message in MESSAGES if message in found] == found, bit
        assert len(found) >= len(MESSAGES) - 1, bit
        assert len(found) + contents.damaged + contents.torn == len(MESSAGES), bit


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_no_damage_raises_or_invents(data: st.DataObject) -> None:
    """Any number of overwritten, inserted or removed bytes gives only records that were written, in order."""
    segment = data.draw(st.sampled_from([written(), written_by_version_0_1()]))
    for _ in range(data.draw(st.integers(1, 4))):
        begin = data.draw(st.integers(0, len(segment)))
        end = data.draw(st.integers(begin, min(len(segment), begin + 40)))
        segment = segment[:begin] + data.draw(st.binary(max_size=40)) + segment[end:]
    contents = unpack(segment, 5)
    indices = [record.index for record in contents.records]
    assert indices == sorted(set(indices))
    assert contents.end > max(indices, default=4)
    assert all(message in MESSAGES for message in messages(contents))


@given(st.binary(max_size=200))
def test_a_file_that_is_not_a_segment_holds_no_records(data: bytes) -> None:
    """Bytes that no daemon wrote give no record, and no error."""
    assert unpack(data, 0).records == []


def test_a_topic_that_mqtt_forbids_is_a_damaged_record() -> None:
    """The MQTT client would refuse to publish it."""
    contents = unpack(MAGIC + pack(0, "a/#", b"{}") + pack(1, "", b"{}") + pack(2, "event", b"{}"), 0)
    assert [record.index for record in contents.records] == [2]
    assert contents.damaged == 2
