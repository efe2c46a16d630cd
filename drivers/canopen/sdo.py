"""Service data objects (CiA 301, 7.2.4): read and write of one object, as requests and answers of eight bytes.

This module is the protocol only, without bus or clock: a transfer is a generator that yields a request and is sent the
answer. `drivers.canopen.sdo_client` runs it.

    expedited (up to 4 bytes)      segmented (7 bytes at a time, a toggle bit in each)
    → initiate   ← answer          → initiate ← answer, → segment ← answer, → segment ← answer, …

The first byte of each is the command specifier (3 bits) and its flags; in initiate frames index, subindex and 4
bytes of data or the size follow. Either side may answer `abort` with a code of 32 bits.

Block transfers (7.2.4.2.9) are not used. A server that answers an upload request with a block upload breaks the
standard; the client aborts that and asks once more.
"""

from __future__ import annotations

import struct
from collections.abc import Generator

from regolithd.drivers.errors import SdoAbortError, SdoBlockOfferedError, SdoProtocolError

Transfer = Generator[
    bytes | None, bytes, bytes
]  # yields a request (None: wait for the next answer), receives answers, returns data

_INITIATE = struct.Struct("<BHB4s")
_EXPEDITED_BYTES = 4
_SEGMENT_BYTES = 7
_MOST_BYTES = 1 << 16  # no object that a master reads is larger

# Command specifiers, first byte (CiA 301, 7.2.4.3).
_DOWNLOAD_INITIATE = 0x20
_DOWNLOAD_INITIATED = 0x60
_DOWNLOAD_SEGMENT = 0x00
_DOWNLOADED_SEGMENT = 0x20
_UPLOAD_INITIATE = 0x40
_UPLOAD_INITIATED = 0x40
_UPLOAD_SEGMENT = 0x60
_UPLOADED_SEGMENT = 0x00
_ABORT = 0x80
_BLOCK_UPLOAD_INITIATED = 0xC0
_SPECIFIER = 0xE0
_TOGGLE = 0x10
_EXPEDITED = 0x02
_SIZE_GIVEN = 0x01
_LAST_SEGMENT = 0x01

ABORT_TOGGLE = 0x05030000
ABORT_TIMEOUT = 0x05040000
ABORT_COMMAND = 0x05040001
ABORT_LENGTH = 0x06070010
ABORT_TEXTS = {
    ABORT_TOGGLE: "toggle bit not alternated",
    ABORT_TIMEOUT: "SDO protocol timed out",
    ABORT_COMMAND: "command specifier not valid or unknown",
    0x05040002: "invalid block size",
    0x05040003: "invalid sequence number",
    0x05040004: "CRC error",
    0x05040005: "out of memory",
    0x06010000: "unsupported access to an object",
    0x06010001: "attempt to read a write-only object",
    0x06010002: "attempt to write a read-only object",
    0x06020000: "object does not exist in the object dictionary",
    0x06040041: "object cannot be mapped to the PDO",
    0x06040042: "the mapped objects would exceed the PDO's length",
    0x06040043: "general parameter incompatibility",
    0x06040047: "general internal incompatibility in the device",
    0x06060000: "access failed because of a hardware error",
    ABORT_LENGTH: "length of the value does not match the data type",
    0x06070012: "value too long for the data type",
    0x06070013: "value too short for the data type",
    0x06090011: "subindex does not exist",
    0x06090030: "invalid value for the parameter",
    0x06090031: "value of the parameter too high",
    0x06090032: "value of the parameter too low",
    0x06090036: "maximum value is less than minimum value",
    0x060A0023: "resource not available: SDO connection",
    0x08000000: "general error",
    0x08000020: "data cannot be transferred or stored to the application",
    0x08000021: "data cannot be transferred or stored to the application because of local control",
    0x08000022: "data cannot be transferred or stored to the application because of the present device state",
    0x08000023: "object dictionary missing, or its generation failed",
    0x08000024: "no data available",
}


def upload(index: int, subindex: int) -> Transfer:
    """Read an object: the transfer returns its bytes."""
    answer = yield from _initiate(_UPLOAD_INITIATE, index, subindex, bytes(4), _UPLOAD_INITIATED)
    flags = answer[0]
    if flags & _EXPEDITED:
        unused = flags >> 2 & 0b11 if flags & _SIZE_GIVEN else 0
        return answer[4 : 8 - unused]
    size = int.from_bytes(answer[4:8], "little") if flags & _SIZE_GIVEN else None
    data = b""
    toggle = 0
    last = False
    while not last:
        answer = yield bytes((_UPLOAD_SEGMENT | toggle,)) + bytes(7)
        _check_segment(answer, _UPLOADED_SEGMENT, toggle, index, subindex)
        unused = answer[0] >> 1 & 0b111
        data += answer[1 : 8 - unused]
        if len(data) > _MOST_BYTES:
            raise SdoProtocolError("sends without end", index=index, subindex=subindex, remedy=_FIRMWARE)
        last = bool(answer[0] & _LAST_SEGMENT)
        toggle ^= _TOGGLE
    if size is not None and len(data) != size:
        raise SdoProtocolError(
            f"announced {size} bytes and sent {len(data)}", index=index, subindex=subindex, remedy=_FIRMWARE
        )
    return data


def download(index: int, subindex: int, data: bytes) -> Transfer:
    """Write an object; the transfer returns no data."""
    if 0 < len(data) <= _EXPEDITED_BYTES:
        unused = _EXPEDITED_BYTES - len(data)
        command = _DOWNLOAD_INITIATE | unused << 2 | _EXPEDITED | _SIZE_GIVEN
        yield from _initiate(command, index, subindex, data.ljust(4, b"\0"), _DOWNLOAD_INITIATED)
        return b""
    size = len(data).to_bytes(4, "little")
    yield from _initiate(_DOWNLOAD_INITIATE | _SIZE_GIVEN, index, subindex, size, _DOWNLOAD_INITIATED)
    toggle = 0
    for start in range(0, max(len(data), 1), _SEGMENT_BYTES):
        segment = data[start : start + _SEGMENT_BYTES]
        last = start + _SEGMENT_BYTES >= len(data)
        command = _DOWNLOAD_SEGMENT | toggle | (_SEGMENT_BYTES - len(segment)) << 1 | (_LAST_SEGMENT if last else 0)
        answer = yield bytes((command,)) + segment.ljust(_SEGMENT_BYTES, b"\0")
        _check_segment(answer, _DOWNLOADED_SEGMENT, toggle, index, subindex)
        toggle ^= _TOGGLE
    return b""


def abort_request(index: int, subindex: int, code: int) -> bytes:
    """Return the request by which the client aborts a transfer."""
    return _INITIATE.pack(_ABORT, index, subindex, code.to_bytes(4, "little"))


def abort_text(code: int) -> str:
    """Return the meaning of an abort code."""
    return ABORT_TEXTS.get(code, "an abort code that CiA 301 does not define")


_FIRMWARE = "The node's SDO server breaks CiA 301; check its firmware"


def _initiate(command: int, index: int, subindex: int, data: bytes, expected: int) -> Transfer:
    """Send an initiate request and return its answer; a late answer for another object is ignored."""
    answer = yield _INITIATE.pack(command, index, subindex, data)
    while _length_checked(answer, index, subindex)[1:4] != struct.pack("<HB", index, subindex):
        answer = yield None
    _raise_abort(answer, index, subindex)
    if expected == _UPLOAD_INITIATED and answer[0] & _SPECIFIER == _BLOCK_UPLOAD_INITIATED:
        what = "answered a segmented upload with a block upload"
        raise SdoBlockOfferedError(what, index=index, subindex=subindex, remedy=_FIRMWARE)
    if answer[0] & _SPECIFIER != expected:
        raise _unexpected(answer, index, subindex)
    return answer


def _check_segment(answer: bytes, expected: int, toggle: int, index: int, subindex: int) -> None:
    _raise_abort(_length_checked(answer, index, subindex), index, subindex)
    if answer[0] & _SPECIFIER != expected:
        raise _unexpected(answer, index, subindex)
    if answer[0] & _TOGGLE != toggle:
        raise SdoProtocolError(ABORT_TEXTS[ABORT_TOGGLE], index=index, subindex=subindex, remedy=_FIRMWARE)


def _length_checked(answer: bytes, index: int, subindex: int) -> bytes:
    if len(answer) != _INITIATE.size:
        what = f"answered with {len(answer)} bytes where SDO frames have 8"
        raise SdoProtocolError(what, index=index, subindex=subindex, remedy=_FIRMWARE)
    return answer


def _unexpected(answer: bytes, index: int, subindex: int) -> SdoProtocolError:
    what = f"answered with command 0x{answer[0]:02X}, which is none for this request"
    return SdoProtocolError(what, index=index, subindex=subindex, remedy=_FIRMWARE)


def _raise_abort(answer: bytes, index: int, subindex: int) -> None:
    if answer[0] == _ABORT:
        code = int.from_bytes(answer[4:8], "little")
        raise SdoAbortError(code, abort_text(code), node_id=None, index=index, subindex=subindex)
