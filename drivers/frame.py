"""A CAN frame as the kernel handed it over: the one thing that is received, logged and replayed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Frame:
    """One classic CAN frame.

    `time_ns` is the kernel's receive time (CLOCK_REALTIME). `sent` marks the echo of a frame that this process sent:
    it has a kernel time as well, which is how a SYNC gets its time.
    """

    time_ns: int
    can_id: int
    data: bytes
    extended: bool = False
    remote: bool = False
    error: bool = False
    sent: bool = False
