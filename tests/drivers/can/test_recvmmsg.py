"""Parsing of the buffers that `recvmmsg` fills; the test fills them itself, so no SocketCAN is needed."""

from __future__ import annotations

import struct

from hypothesis import given
from hypothesis import strategies as st

from regolithd.drivers.can.counters import BusCounters
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.recvmmsg import BATCH, CAN_FRAME, SO_RXQ_OVFL, SO_TIMESTAMPNS, RecvmmsgBuffers

CONFIRM = 0x800
SOL_SOCKET = 1


def put(
    batch: RecvmmsgBuffers, place: int, raw: bytes, *, flags: int = 0, drops: int | None = None, size: int = 16
) -> None:
    """Fill the buffers of one message as the kernel does."""
    start = place * CAN_FRAME.size
    batch._frames[start : start + CAN_FRAME.size] = raw.ljust(16, b"\0")[:16]
    control = struct.pack("@Niill", struct.calcsize("@Niill"), SOL_SOCKET, SO_TIMESTAMPNS, 1_700_000_000, 123 + place)
    if drops is not None:
        control += struct.pack("@NiiI0N", struct.calcsize("@NiiI"), SOL_SOCKET, SO_RXQ_OVFL, drops)
    batch._control[place * 64 : place * 64 + len(control)] = control
    header = batch._headers[place]
    header.header.control_length, header.header.flags, header.length = len(control), flags, size


def test_flags_of_identifier_and_message_are_distinguished() -> None:
    """Standard, extended, remote and error frames, and echoes, are parsed as such."""
    batch, counters = RecvmmsgBuffers(), BusCounters()
    for place, (can_id, flags) in enumerate(
        [(0x181, 0), (0x80012345, 0), (0x40000181, 0), (0x20000040, 0), (0x080, CONFIRM)]
    ):
        put(batch, place, struct.pack("=IB3x8s", can_id, 2, b"\1\2"), flags=flags)
    t = 1_700_000_000 * 10**9 + 123
    assert batch._parse(5, counters) == [
        Frame(t, 0x181, b"\1\2"),
        Frame(t + 1, 0x12345, b"\1\2", extended=True),
        Frame(t + 2, 0x181, b"\1\2", remote=True),
        Frame(t + 3, 0x040, b"\1\2", error=True),
        Frame(t + 4, 0x080, b"\1\2", sent=True),
    ]


def test_drops_are_counted_by_difference_and_across_the_overflow() -> None:
    """The kernel reports the total modulo 2³², and only after the first drop."""
    batch, counters = RecvmmsgBuffers(), BusCounters()
    for drops, total in ((None, 0), (3, 3), (3, 3), (None, 3), (10, 10), (2**32 - 1, 2**32 - 1), (4, 2**32 + 4)):
        put(batch, 0, struct.pack("=IB3x8s", 0x181, 8, bytes(8)), drops=drops)
        assert len(batch._parse(1, counters)) == 1
        assert counters.kernel_drops == total


@given(st.lists(st.tuples(st.binary(min_size=16, max_size=16), st.sampled_from([0, CONFIRM])), max_size=BATCH))
def test_any_bytes_are_parsed_or_counted(messages: list[tuple[bytes, int]]) -> None:
    """Every message is a frame of at most 8 bytes or counted as malformed, without an exception."""
    batch, counters = RecvmmsgBuffers(), BusCounters()
    for place, (raw, flags) in enumerate(messages):
        put(batch, place, raw, flags=flags)
    frames = batch._parse(len(messages), counters)
    assert len(frames) + counters.malformed == len(messages)
    assert all(len(frame.data) <= 8 and 0 <= frame.can_id < 1 << 29 for frame in frames)


def test_a_can_fd_frame_is_counted_as_malformed() -> None:
    """A CAN FD frame, truncated to the size of the buffer, is not returned."""
    batch, counters = RecvmmsgBuffers(), BusCounters()
    put(batch, 0, bytes(16), size=72)
    assert batch._parse(1, counters) == []
    assert counters.malformed == 1
