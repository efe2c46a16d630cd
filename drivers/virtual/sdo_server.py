"""The SDO server (CiA 301, 7.2.4): expedited and segmented transfers, both ways; one at a time.

    command byte   client → server              server → client
    0x2_           initiate download            0x60
    0x0_ / 0x1_    download segment, toggle     0x20 / 0x30
    0x40           initiate upload              0x4_
    0x60 / 0x70    upload segment, toggle       0x0_ / 0x1_
    0x80           abort                        abort

Block transfer is optional and refused (0x05040001), which clients answer by a segmented one.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.sdo_abort import Abort, AbortError

if TYPE_CHECKING:
    from regolithd.drivers.devices.virtual.device import Key
    from regolithd.drivers.virtual.object_dictionary import Dictionary

_HEADER = struct.Struct("<BHB")
_ABORT = struct.Struct("<BHBI")
_EXPEDITED = 0x02
_SIZE_GIVEN = 0x01
_TOGGLE = 0x10
_LAST = 0x01
_SEGMENT = 7


@dataclass(slots=True)
class _Transfer:
    """A segmented transfer under way: the data still to be sent, or received so far."""

    key: Key
    upload: bool
    data: bytearray
    size: int | None = None
    toggle: int = 0


class SdoServer:
    """Answers requests to one object dictionary."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._transfer: _Transfer | None = None

    def reset(self) -> None:
        """Abandon the transfer under way."""
        self._transfer = None

    def answer(self, request: bytes) -> bytes | None:
        """Return the answer to one request, or None where CiA 301 requires none."""
        if len(request) != 8:
            return None
        command, index, sub = _HEADER.unpack_from(request)
        specifier = command >> 5
        key = (index, sub)
        if specifier in {0, 3} and self._transfer is not None:
            key = self._transfer.key
        try:
            return self._serve(specifier, request, (index, sub))
        except AbortError as error:
            self._transfer = None
            return _ABORT.pack(0x80, *key, error.code)

    def _serve(self, specifier: int, request: bytes, key: Key) -> bytes | None:
        command = request[0]
        if specifier == 4:
            self._transfer = None
            return None
        if specifier == 0:
            return self._download_segment(command, request[1:])
        if specifier == 1:
            return self._download(command, key, request[4:])
        if specifier == 2:
            return self._upload(key)
        if specifier == 3:
            return self._upload_segment(command)
        raise AbortError(Abort.COMMAND)

    def _download(self, command: int, key: Key, data: bytes) -> bytes:
        self._transfer = None
        if command & _EXPEDITED:
            unused = (command >> 2) & 3 if command & _SIZE_GIVEN else 0
            self._dictionary.write(key, data[: 4 - unused])
        else:
            self._dictionary.check_writable(key)
            size = struct.unpack("<I", data)[0] if command & _SIZE_GIVEN else None
            self._transfer = _Transfer(key, upload=False, data=bytearray(), size=size)
        return _HEADER.pack(0x60, *key) + bytes(4)

    def _download_segment(self, command: int, data: bytes) -> bytes:
        transfer = self._under_way(command, upload=False)
        transfer.data += data[: _SEGMENT - ((command >> 1) & 7)]
        if command & _LAST:
            if transfer.size not in {None, len(transfer.data)}:
                raise AbortError(Abort.TOO_SHORT)
            self._dictionary.write(transfer.key, bytes(transfer.data))
            self._transfer = None
        answer = 0x20 | transfer.toggle
        transfer.toggle ^= _TOGGLE
        return bytes((answer,)) + bytes(7)

    def _upload(self, key: Key) -> bytes:
        self._transfer = None
        data = self._dictionary.read(key)
        if 0 < len(data) <= 4:
            return _HEADER.pack(0x43 | (4 - len(data)) << 2, *key) + data.ljust(4, b"\0")
        self._transfer = _Transfer(key, upload=True, data=bytearray(data))
        return _HEADER.pack(0x41, *key) + struct.pack("<I", len(data))

    def _upload_segment(self, command: int) -> bytes:
        transfer = self._under_way(command, upload=True)
        part, left = transfer.data[:_SEGMENT], transfer.data[_SEGMENT:]
        answer = transfer.toggle | (_SEGMENT - len(part)) << 1 | (0 if left else _LAST)
        transfer.data, transfer.toggle = left, transfer.toggle ^ _TOGGLE
        if not left:
            self._transfer = None
        return bytes((answer,)) + bytes(part).ljust(7, b"\0")

    def _under_way(self, command: int, *, upload: bool) -> _Transfer:
        """Return the transfer that a segment belongs to, or abort."""
        transfer = self._transfer
        if transfer is None or transfer.upload is not upload:
            raise AbortError(Abort.COMMAND)
        if command & _TOGGLE != transfer.toggle:
            raise AbortError(Abort.TOGGLE)
        return transfer
