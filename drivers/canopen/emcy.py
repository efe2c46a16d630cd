"""Emergency messages (CiA 301, 7.2.7): eight bytes that say what is wrong inside a node.

    byte   0–1         2               3–7
           error code  error register  manufacturer's own
           (LE)        (0x1001)

The high byte of the code is CiA 301's error class; some codes are defined by CiA 301 in full, others by the device's
manufacturer (`Device.error_texts`). Code 0x0000 says that an error has been reset.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import cob_id

if TYPE_CHECKING:
    from collections.abc import Mapping

_EMCY = struct.Struct("<HB5s")

# CiA 301, table 26; a class is looked up by its first two digits, then by the first alone.
_CLASSES = {
    0x00: "no error, or an error is reset",
    0x10: "generic error",
    0x20: "current",
    0x21: "current on the device's input side",
    0x22: "current inside the device",
    0x23: "current on the device's output side",
    0x30: "voltage",
    0x31: "mains voltage",
    0x32: "voltage inside the device",
    0x33: "output voltage",
    0x40: "temperature",
    0x41: "ambient temperature",
    0x42: "device temperature",
    0x50: "device hardware",
    0x60: "device software",
    0x61: "internal software",
    0x62: "user software",
    0x63: "data set",
    0x70: "additional modules",
    0x80: "monitoring",
    0x81: "communication",
    0x82: "protocol",
    0x90: "external error",
    0xF0: "additional functions",
    0xFF: "device-specific error",
}
_CODES = {
    0x8110: "CAN overrun: messages were lost",
    0x8120: "CAN controller is error passive",
    0x8130: "life guard or heartbeat error: the node has lost its master",
    0x8140: "recovered from bus-off",
    0x8150: "CAN-ID collision: another node uses the same identifier",
    0x8210: "PDO not processed: too short",
    0x8220: "PDO longer than its mapping",
    0x8240: "SYNC of unexpected length",
    0x8250: "RPDO overdue",
}
_REGISTER_BITS = (
    "generic",
    "current",
    "voltage",
    "temperature",
    "communication",
    "profile",
    "reserved",
    "manufacturer",
)


_NO_TEXTS: Mapping[int, str] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Emergency:
    """A received EMCY message.

    `code` 0x0000 means that the error has been reset; `register` is object 0x1001; `vendor` are the five bytes that
    the manufacturer defines.
    """

    time_ns: int
    node_id: int
    code: int
    register: int
    vendor: bytes
    text: str

    @property
    def cleared(self) -> bool:
        """Whether it reports the reset of an error."""
        return self.code == 0


def error_text(code: int, manufacturer: Mapping[int, str] = _NO_TEXTS) -> str:
    """Return the meaning of an error code: the manufacturer's, CiA 301's, or that of its class."""
    text = manufacturer.get(code) or _CODES.get(code)
    if text is None:
        high = code >> 8
        text = _CLASSES.get(high) or _CLASSES.get(high & 0xF0, "reserved error class")
    return text


def register_bits(register: int) -> tuple[str, ...]:
    """Return the kinds of error whose bits are set in the error register (0x1001)."""
    return tuple(name for bit, name in enumerate(_REGISTER_BITS) if register >> bit & 1)


def parse(frame: Frame, node_id: int, manufacturer: Mapping[int, str] = _NO_TEXTS) -> Emergency | None:
    """Return the emergency in a frame, or None where it does not have the eight bytes of one."""
    if len(frame.data) != _EMCY.size:
        return None
    code, register, vendor = _EMCY.unpack(frame.data)
    return Emergency(frame.time_ns, node_id, code, register, vendor, error_text(code, manufacturer))


def emergency_frame(node_id: int, code: int, register: int, vendor: bytes = bytes(5)) -> Frame:
    """Return the frame by which `node_id` reports an error."""
    return Frame(0, cob_id.EMCY + node_id, _EMCY.pack(code, register, vendor))
