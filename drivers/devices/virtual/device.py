"""Base class of the virtual devices: what a virtual node measures and does, behind its CANopen services."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from regolithd.drivers.devices.virtual.measurement import Measurement

Key = tuple[int, int]
"""Index and sub-index of an object."""


class ObjectValues(Protocol):
    """The values of the node's object dictionary, as the device itself reads and sets them."""

    def get(self, index: int, sub: int = 0) -> int:
        """Return a value."""

    def put(self, index: int, sub: int, value: int) -> None:
        """Set a value."""


class ErrorReports(Protocol):
    """The node's EMCY producer."""

    def set(self, code: int, detail: bytes = b"") -> None:
        """Report an error, once for as long as it lasts."""

    def clear(self, code: int | None = None) -> None:
        """End one error, or all."""


class VirtualDevice:
    """A device that measures nothing; each kind overrides what it does.

    `wheel` is 0–5, or None for a device of the body.
    """

    latches_errors = False
    """An error lasts until the device is told to reset it, not only until its cause has gone."""

    def __init__(self, dictionary: ObjectValues, errors: ErrorReports, wheel: int | None) -> None:
        self.dictionary = dictionary
        self.errors = errors
        self.wheel = wheel

    def reset(self) -> None:
        """Start anew, as after power-on."""

    def check(self, key: Key, value: int) -> None:
        """Raise `AbortError` where the device does not accept a value."""

    def written(self, key: Key, value: int) -> None:
        """Act on a value that an SDO or a PDO brought."""

    def advance(self, elapsed_s: float) -> None:
        """Let time pass."""

    def measure(self, measurement: Measurement) -> None:
        """Put what is measured into the object dictionary."""

    def connection_lost(self) -> None:
        """React to the loss of the master's heartbeat, or to the NMT command `stop`."""
