"""Emergency messages (CiA 301, 7.2.7): eight bytes that say what is wrong inside a node.

    byte   0–1         2               3–7
           error code  error register  manufacturer's own
           (LE)        (0x1001)

The high byte of the code is CiA 301's error class; codes that CiA 301 or the maker of the motor controller define more
closely have words of their own. Code 0x0000 says that an error is gone.
"""

from __future__ import annotations

import struct

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.signals import Emergency, NodeKind

EMCY_COB_ID = 0x080  # + node-ID
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
    0x8130: "life guard or heartbeat error: the node no longer hears its master",
    0x8140: "recovered from bus-off",
    0x8150: "CAN-ID collision: another node uses the same identifier",
    0x8210: "PDO not processed: too short",
    0x8220: "PDO longer than its mapping",
    0x8240: "SYNC of unexpected length",
    0x8250: "RPDO overdue",
}
# EPOS firmware specification, chapter "Error codes".
_EPOS_CODES = {
    0x2310: "overcurrent: short circuit, or the current controller is badly tuned",
    0x3210: "overvoltage: supply too high, or energy fed back while braking",
    0x3220: "undervoltage: supply too weak for the acceleration",
    0x4210: "overtemperature of the power stage",
    0x5113: "internal 5 V supply too low",
    0x6100: "internal software error",
    0x6320: "software parameter out of range",
    0x7320: "position sensor error: encoder cable or supply",
    0x8111: "CAN overrun",
    0x81FD: "CAN bus-off",
    0x81FE: "CAN receive queue overrun",
    0x81FF: "CAN transmit queue overrun",
    0x8611: "following error: the motor cannot follow its demand",
    0xFF01: "Hall sensor error",
    0xFF02: "encoder index not found",
    0xFF03: "encoder resolution wrong",
    0xFF04: "Hall sensor not found",
    0xFF06: "negative limit switch",
    0xFF07: "positive limit switch",
    0xFF08: "Hall angle detection error",
    0xFF09: "software position limit",
    0xFF0A: "position sensor breach",
    0xFF0B: "system overloaded",
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


def error_text(code: int, kind: NodeKind | None = None) -> str:
    """Return an error code in words: the maker's for this kind of node, CiA 301's, or its class."""
    own = _EPOS_CODES.get(code) if kind is NodeKind.MOTOR else None
    text = own or _CODES.get(code)
    if text is None:
        high = code >> 8
        text = _CLASSES.get(high) or _CLASSES.get(high & 0xF0, "reserved error class")
    return text


def register_bits(register: int) -> tuple[str, ...]:
    """Return which kinds of error the error register (0x1001) says are present."""
    return tuple(name for bit, name in enumerate(_REGISTER_BITS) if register >> bit & 1)


def parse(frame: Frame, node_id: int, kind: NodeKind | None = None) -> Emergency | None:
    """Return the emergency in a frame, or None where it has not the eight bytes of one."""
    if len(frame.data) != _EMCY.size:
        return None
    code, register, vendor = _EMCY.unpack(frame.data)
    return Emergency(frame.time_ns, node_id, code, register, vendor, error_text(code, kind))


def emergency_frame(node_id: int, code: int, register: int, vendor: bytes = bytes(5)) -> Frame:
    """Return the frame by which `node_id` reports an error."""
    return Frame(0, EMCY_COB_ID + node_id, _EMCY.pack(code, register, vendor))
