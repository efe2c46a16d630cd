"""SocketCAN's error frames (linux/can/error.h): what the CAN controller reports of the bus and of itself.

The classes are bits of the identifier; for the class `controller`, byte 1 says in which error state it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.drivers.can.bus import BusState

if TYPE_CHECKING:
    from regolithd.drivers.can.frame import Frame

CLASSES = {
    0x001: "transmit-timeout",
    0x002: "lost-arbitration",
    0x004: "controller",
    0x008: "protocol",
    0x010: "transceiver",
    0x020: "no-acknowledge",
    0x040: "bus-off",
    0x080: "bus-error",
    0x100: "restarted",
}
_CONTROLLER = 0x004
_BUS_OFF = 0x040
_RESTARTED = 0x100

# Byte 1 of the class `controller`.
_OVERFLOWS = {0x01: "receive-overflow", 0x02: "transmit-overflow"}
_WARNING = 0x04 | 0x08  # receive, transmit error counter above 96
_PASSIVE = 0x10 | 0x20  # above 127
_ACTIVE = 0x40


def error_classes(frame: Frame) -> list[str]:
    """Return the names of the error classes in an error frame."""
    names = [name for bit, name in CLASSES.items() if frame.can_id & bit]
    if frame.can_id & _CONTROLLER and len(frame.data) > 1:
        names += [name for bit, name in _OVERFLOWS.items() if frame.data[1] & bit]
    return names


def reported_state(frame: Frame) -> BusState | None:
    """Return the controller's error state that an error frame reports, or None where it reports none."""
    if frame.can_id & _BUS_OFF:
        return BusState.OFF
    if frame.can_id & _RESTARTED:
        return BusState.ACTIVE
    if not frame.can_id & _CONTROLLER or len(frame.data) < 2:
        return None
    for bits, state in ((_PASSIVE, BusState.PASSIVE), (_WARNING, BusState.WARNING), (_ACTIVE, BusState.ACTIVE)):
        if frame.data[1] & bits:
            return state
    return None
