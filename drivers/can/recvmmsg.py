"""`recvmmsg`: receives up to 64 CAN frames, their kernel times and the drop counter with one system call.

Python's socket module does not have it, so it is called through ctypes, with buffers that are allocated once and parsed
by three structs that iterate over all messages of the batch. Sizes follow the platform's C types.

    frames    64 × struct can_frame          identifier and flags, length, 8 data bytes
    control   64 × 64 bytes                  cmsg SO_TIMESTAMPNS, then, once frames were dropped, cmsg SO_RXQ_OVFL
    headers   64 × struct mmsghdr            addresses of the two; flags and length as the kernel returns them
"""

from __future__ import annotations

import ctypes
import os
import struct
from typing import TYPE_CHECKING

from regolithd.drivers.can.frame import Frame

if TYPE_CHECKING:
    from regolithd.drivers.can.counters import BusCounters

BATCH = 64

SO_TIMESTAMPNS = 35
SO_RXQ_OVFL = 40
_MSG_DONTWAIT = 0x40
_MSG_CONFIRM = 0x800  # the frame is the echo of one sent on this very socket (linux/Documentation/networking/can.rst)

_EXTENDED = 0x80000000
_REMOTE = 0x40000000
_ERROR = 0x20000000
_STANDARD_MASK = 0x7FF
_EXTENDED_MASK = 0x1FFFFFFF

CAN_FRAME = struct.Struct("=IB3x8s")
_CONTROL_BYTES = 64
_TIME = struct.Struct("@Niill")  # cmsghdr (length, level, type) and timespec
_DROPS = struct.Struct("@NiiI")  # cmsghdr and the counter
_CONTROL = struct.Struct(f"@Niill0NNiiI{_CONTROL_BYTES - struct.calcsize('@Niill0NNiiI')}x")
_HEADER = struct.Struct("@PIPNPNi0PI0P")


class _IoVec(ctypes.Structure):
    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _MsgHdr(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint32),
        ("iov", ctypes.c_void_p),
        ("iov_count", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _MMsgHdr(ctypes.Structure):
    _fields_ = (("header", _MsgHdr), ("length", ctypes.c_uint))


_recvmmsg = ctypes.CDLL(None, use_errno=True).recvmmsg
_recvmmsg.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)
_recvmmsg.restype = ctypes.c_int


class RecvmmsgBuffers:
    """The buffers of one socket, and the system call that fills them."""

    def __init__(self) -> None:
        self._frames = bytearray(BATCH * CAN_FRAME.size)
        self._control = bytearray(BATCH * _CONTROL_BYTES)
        self._vectors = (_IoVec * BATCH)()
        self._headers = (_MMsgHdr * BATCH)()
        self._drops: int | None = None
        frames = ctypes.addressof(ctypes.c_char.from_buffer(self._frames))
        control = ctypes.addressof(ctypes.c_char.from_buffer(self._control))
        for place in range(BATCH):
            self._vectors[place] = _IoVec(frames + place * CAN_FRAME.size, CAN_FRAME.size)
            header = self._headers[place].header
            header.iov = ctypes.addressof(self._vectors[place])
            header.iov_count = 1
            header.control = control + place * _CONTROL_BYTES
            header.control_length = _CONTROL_BYTES
        self._header_bytes = memoryview(self._headers).cast("B")
        self._fresh_headers = bytes(self._header_bytes)
        self._address = ctypes.addressof(self._headers)

    def receive(self, descriptor: int, counters: BusCounters) -> list[Frame]:
        """Return the frames waiting at a non-blocking socket, at most `BATCH`; empty where there are none.

        Counts dropped and malformed frames in `counters`.

        Raises
        ------
        OSError
            The kernel's error: ENETDOWN, ENODEV, …
        """
        self._header_bytes[:] = self._fresh_headers
        count = _recvmmsg(descriptor, self._address, BATCH, _MSG_DONTWAIT, None)
        if count < 0:
            number = ctypes.get_errno()
            if number in (11, 4):  # EAGAIN, EINTR
                return []
            raise OSError(number, os.strerror(number))
        return self._parse(count, counters)

    def _parse(self, count: int, counters: BusCounters) -> list[Frame]:
        frames = []
        raw = CAN_FRAME.iter_unpack(memoryview(self._frames)[: count * CAN_FRAME.size])
        control = _CONTROL.iter_unpack(memoryview(self._control)[: count * _CONTROL_BYTES])
        headers = _HEADER.iter_unpack(self._header_bytes[: count * _HEADER.size])
        for (can_id, length, data), cmsg, header in zip(raw, control, headers, strict=True):
            control_length, flags, size = header[5:]
            if size != CAN_FRAME.size or length > 8:
                counters.malformed += 1
                continue
            if control_length >= _TIME.size + _DROPS.size:
                self._count_drops(cmsg[8], counters)
            time_ns = cmsg[3] * 1_000_000_000 + cmsg[4]
            payload = data if length == 8 else data[:length]
            sent = flags & _MSG_CONFIRM != 0
            if can_id <= _STANDARD_MASK:
                frames.append(Frame(time_ns, can_id, payload, False, False, False, sent))
            else:
                frames.append(_unusual(time_ns, can_id, payload, sent=sent))
        return frames

    def _count_drops(self, total: int, counters: BusCounters) -> None:
        """Count the difference: the kernel counts since the socket was opened, modulo 2³²."""
        counters.kernel_drops += (total - (self._drops or 0)) & 0xFFFFFFFF
        self._drops = total


def _unusual(time_ns: int, can_id: int, data: bytes, *, sent: bool) -> Frame:
    extended = bool(can_id & _EXTENDED)
    mask = _EXTENDED_MASK if can_id & (_EXTENDED | _ERROR) else _STANDARD_MASK
    remote, error = bool(can_id & _REMOTE), bool(can_id & _ERROR)
    return Frame(time_ns, can_id & mask, data, extended=extended, remote=remote, error=error, sent=sent)
