"""Numbers of Linux's headers: asm-generic/socket.h, linux/can.h, linux/can/raw.h, linux/can/error.h.

Written out once more from the source: two ends of this project agree about a number also where both have it from one
wrong constant, so that no test between the master and its virtual nodes could tell.
"""

from __future__ import annotations

import errno
import socket

from stated_numbers import differing

from regolithd.drivers.can.error_frame import CLASSES

NUMBERS = {
    "can.recvmmsg": {
        "SO_TIMESTAMPNS": 35,
        "SO_RXQ_OVFL": 40,
        "_MSG_DONTWAIT": int(socket.MSG_DONTWAIT),
        "_MSG_CONFIRM": int(socket.MSG_CONFIRM),
        "_EXTENDED": socket.CAN_EFF_FLAG,
        "_REMOTE": socket.CAN_RTR_FLAG,
        "_ERROR": socket.CAN_ERR_FLAG,
        "_STANDARD_MASK": socket.CAN_SFF_MASK,
        "_EXTENDED_MASK": socket.CAN_EFF_MASK,
    },
    "can.socketcan": {
        "_EXTENDED": socket.CAN_EFF_FLAG,
        "_REMOTE": socket.CAN_RTR_FLAG,
        "_CAN_RAW_ERR_FILTER": 2,
        "_ALL_ERRORS": socket.CAN_ERR_MASK,
        "_SO_RCVBUFFORCE": 33,
        "_FULL": (errno.ENOBUFS, errno.EAGAIN),
        "_GONE": (errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.ENETUNREACH),
    },
    "can.error_frame": {
        "_CONTROLLER": 4,
        "_BUS_OFF": 64,
        "_RESTARTED": 256,
        "_WARNING": 4 + 8,
        "_PASSIVE": 16 + 32,
        "_ACTIVE": 64,
        "_OVERFLOWS": {1: "receive-overflow", 2: "transmit-overflow"},
    },
}


def test_numbers_of_a_standard_are_the_standard_s() -> None:
    """Object indices, bits, command specifiers, abort codes, options of a socket."""
    assert differing("drivers", NUMBERS) == {}


ERROR_CLASSES = (
    "transmit-timeout lost-arbitration controller protocol transceiver no-acknowledge bus-off bus-error restarted"
)


def test_error_classes_are_the_bits_of_linux_can_error_h() -> None:
    """From bit 0 on, in the header's order."""
    assert {1 << bit: name for bit, name in enumerate(ERROR_CLASSES.split())} == CLASSES
