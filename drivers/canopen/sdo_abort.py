"""SDO abort codes (CiA 301, 7.2.4.3.17) that the virtual nodes send."""

from __future__ import annotations

from enum import IntEnum


class Abort(IntEnum):
    """An abort code."""

    TOGGLE = 0x0503_0000  # toggle bit not alternated
    COMMAND = 0x0504_0001  # client command specifier not valid or unknown
    UNSUPPORTED_ACCESS = 0x0601_0000
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    NOT_MAPPABLE = 0x0604_0041
    PDO_LENGTH = 0x0604_0042  # the mapped objects exceed a PDO's 64 bits
    HARDWARE = 0x0606_0000
    TOO_LONG = 0x0607_0012
    TOO_SHORT = 0x0607_0013
    NO_SUBINDEX = 0x0609_0011
    INVALID_VALUE = 0x0609_0030
    TOO_HIGH = 0x0609_0031
    TOO_LOW = 0x0609_0032
    GENERAL = 0x0800_0000
    DEVICE_STATE = 0x0800_0022  # not in the device's present state


class AbortError(Exception):
    """A virtual node refuses a request."""

    def __init__(self, code: Abort) -> None:
        self.code = code
        super().__init__(f"0x{code:08X} {code.name}")
