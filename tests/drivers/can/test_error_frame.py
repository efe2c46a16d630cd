"""SocketCAN error frames."""

from __future__ import annotations

import pytest

from regolithd.drivers.can.bus import BusState
from regolithd.drivers.can.error_frame import error_classes, reported_state
from regolithd.drivers.can.frame import Frame


@pytest.mark.parametrize(
    ("can_id", "data", "classes", "state"),
    [
        (0x040, bytes(8), ["bus-off"], BusState.OFF),
        (0x100, bytes(8), ["restarted"], BusState.ACTIVE),
        (0x004, b"\0\x08\0\0\0\0\x80\0", ["controller"], BusState.WARNING),
        (0x004, b"\0\x20\0\0\0\0\x90\0", ["controller"], BusState.PASSIVE),
        (0x004, b"\0\x01\0\0\0\0\0\0", ["controller", "receive-overflow"], None),
        (0x004, b"\0\x40\0\0\0\0\0\0", ["controller"], BusState.ACTIVE),
        (0x088, bytes(8), ["protocol", "bus-error"], None),
        (0x020, bytes(8), ["no-acknowledge"], None),
        (0x004, b"", ["controller"], None),
    ],
)
def test_an_error_frame_is_classified(can_id: int, data: bytes, classes: list[str], state: BusState | None) -> None:
    """Error classes and controller state follow from the bits of linux/can/error.h."""
    frame = Frame(0, can_id, data, error=True)
    assert error_classes(frame) == classes
    assert reported_state(frame) is state
