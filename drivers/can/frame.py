"""A CAN frame with its receive time: what is received, recorded and replayed."""

from __future__ import annotations

from typing import NamedTuple


class Frame(NamedTuple):
    """One classic CAN frame.

    Thousands are created each second: a named tuple takes 0.3 µs to create, a frozen dataclass 1.0 µs.

    `time_ns` is the kernel's receive time (CLOCK_REALTIME). `sent` marks the echo of a frame that this process sent:
    it has a kernel time as well, which is the time of a SYNC.
    """

    time_ns: int
    can_id: int
    data: bytes
    extended: bool = False
    remote: bool = False
    error: bool = False
    sent: bool = False

    @property
    def ordinary(self) -> bool:
        """Whether it is a data frame with an 11-bit identifier, as CANopen uses them."""
        return not (self.extended or self.remote or self.error)
