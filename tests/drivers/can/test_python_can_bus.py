"""Conversion of python-can's messages to frames."""

from __future__ import annotations

import time

import can

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.python_can_bus import PythonCanBus, _frame


def test_a_frame_has_the_adapters_time_stamp() -> None:
    """Seconds become nanoseconds, and every flag is kept."""
    message = can.Message(12.5, 0x181, is_extended_id=False, data=b"ab", is_rx=False)
    assert _frame(message) == Frame(12_500_000_000, 0x181, b"ab", sent=True)


def test_a_frame_without_time_stamp_has_the_present_time() -> None:
    """An adapter that does not stamp frames reports 0."""
    before_ns = time.time_ns()
    assert before_ns <= _frame(can.Message(0.0, 0x181, is_extended_id=False)).time_ns <= time.time_ns()


async def test_error_frames_alone_are_counted_as_errors() -> None:
    """They are delivered as well; python-can does not say of which class they are."""
    with can.Bus(interface="virtual", channel="error-frames") as other:
        bus = PythonCanBus("virtual", "error-frames")
        for error in (False, True, False):
            other.send(can.Message(arbitration_id=0x181, is_extended_id=False, is_error_frame=error))
        frames: list[Frame] = []
        while len(frames) < 3:
            frames += await bus.receive()
        bus.close()
    assert [frame.error for frame in frames] == [False, True, False]
    assert bus.counters.errors["adapter"] == 1
