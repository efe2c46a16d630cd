"""SocketCAN with its own raw socket: an asyncio reader with kernel times, error frames and the drop counter.

    CAN_RAW_RECV_OWN_MSGS   receive our own frames with their kernel time (a SYNC's is the snapshot's time)
    CAN_RAW_ERR_FILTER      receive the controller's error frames
    SO_TIMESTAMPNS          kernel receive time, CLOCK_REALTIME in ns
    SO_RXQ_OVFL             number of frames that the kernel discarded because the receive queue was full
    SO_RCVBUF               receive buffer as large as the kernel allows; SO_RCVBUFFORCE where permitted

The socket stays open while its link is down; after an adapter was unplugged it is opened again.
"""

from __future__ import annotations

import asyncio
import errno
import socket
import struct
from pathlib import Path
from typing import TYPE_CHECKING

from regolithd.drivers.can.bus import Bus, BusState
from regolithd.drivers.can.error_frame import error_classes, reported_state
from regolithd.drivers.can.moderated_reader import ModeratedReader
from regolithd.drivers.can.recvmmsg import BATCH, CAN_FRAME, SO_RXQ_OVFL, SO_TIMESTAMPNS, RecvmmsgBuffers
from regolithd.drivers.errors import BusDownError, BusFullError, BusOpenError

if TYPE_CHECKING:
    from regolithd.drivers.can.frame import Frame

_EXTENDED = 0x80000000
_REMOTE = 0x40000000
_CAN_RAW_ERR_FILTER = 2  # linux/can/raw.h; not in every build of Python's socket module
_ALL_ERRORS = 0x1FFFFFFF
_SO_RCVBUFFORCE = 33
_RECEIVE_BUFFER_BYTES = 4 << 20
_ROUNDS = 8  # batches per wake-up, so that a flood of frames leaves time for other tasks
_FULL = (errno.ENOBUFS, errno.EAGAIN)
_GONE = (errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.ENETUNREACH)
_RETRY_FIRST_S = 0.0005
_RETRY_TOTAL_S = 0.1  # longer than any frame waits on a working bus
_REOPEN_S = 1.0
NETWORK_LINKS = Path("/sys/class/net")
CAN_LINK_TYPE = "280"  # ARPHRD_CAN, if_arp.h


class SocketCanBus(Bus):
    """A SocketCAN link."""

    def __init__(self, channel: str) -> None:
        super().__init__("socketcan", channel)
        self._loop = asyncio.get_running_loop()
        self._batch = RecvmmsgBuffers()
        self._socket = _open_socket(channel)
        self._reopening: asyncio.TimerHandle | None = None
        self._reader = ModeratedReader(self._socket, self._drain)

    async def send(self, frame: Frame) -> None:
        """See `Bus.send`."""
        can_id = frame.can_id | (_EXTENDED if frame.extended else 0) | (_REMOTE if frame.remote else 0)
        data = CAN_FRAME.pack(can_id, len(frame.data), frame.data)
        wait_s, waited_s = _RETRY_FIRST_S, 0.0
        while True:
            try:
                self._socket.send(data)
            except OSError as error:
                if error.errno not in _FULL:
                    raise self._not_sent(error) from error
                if waited_s >= _RETRY_TOTAL_S:
                    self.counters.transmit_failures += 1
                    raise BusFullError(
                        f"{self.channel}: the transmit queue stayed full for {_RETRY_TOTAL_S:g} s",
                        remedy=f"Does any other node acknowledge? Then: ip link set {self.channel} txqueuelen 1000",
                    ) from error
                self.counters.transmit_retries += 1
                await asyncio.sleep(wait_s)
                waited_s += wait_s
                wait_s *= 2.0
            else:
                self.counters.sent += 1
                return

    def close(self) -> None:
        """Close the socket, after reading the frames that wait: the last ones sent are heard, counted and recorded."""
        if self._reader.running:
            self._drain()
        if self._reopening is not None:
            self._reopening.cancel()
        self._reader.stop()
        self._socket.close()

    def resume_reading(self) -> None:
        """Resume reading after the consumer has caught up; the kernel has counted what it dropped meanwhile."""
        self._reader.start()

    def pause_reading(self) -> None:
        """Stop reading; the kernel keeps frames, and counts what it drops."""
        self._reader.stop()

    def _drain(self) -> bool:
        """Read the frames waiting at the socket, batch by batch; return whether there were any."""
        found = False
        try:
            for _ in range(_ROUNDS):
                frames = self._batch.receive(self._socket.fileno(), self.counters)
                if frames:
                    self._take(frames)
                    found = True
                if len(frames) < BATCH:
                    break
        except OSError as error:
            self._lost(error)
        return found

    def _take(self, frames: list[Frame]) -> None:
        for frame in frames:
            if frame.error:
                self._take_error(frame)
            elif self.state is BusState.DOWN or (self.state is BusState.OFF and not frame.sent):
                self.change_state(BusState.ACTIVE)
        self.deliver(frames)

    def _take_error(self, frame: Frame) -> None:
        self.counters.errors.update(error_classes(frame))
        state = reported_state(frame)
        if state is not None:
            self.change_state(state)

    def _not_sent(self, error: OSError) -> BusDownError:
        self.counters.transmit_failures += 1
        if error.errno in _GONE:
            self._lost(error)
        return BusDownError(
            f"{self.channel}: cannot send: {error.strerror}", remedy=f"Bring it up: ip link set {self.channel} up"
        )

    def _lost(self, error: OSError) -> None:
        """Set the state to down; where the network device is gone, try to open it again."""
        self.change_state(BusState.DOWN)
        if error.errno in (errno.ENODEV, errno.ENXIO) and self._reopening is None:
            self._reader.stop()
            self._reopening = self._loop.call_later(_REOPEN_S, self._reopen)

    def _reopen(self) -> None:
        try:
            fresh = _open_socket(self.channel)
        except BusOpenError:
            self._reopening = self._loop.call_later(_REOPEN_S, self._reopen)
            return
        self._reopening = None
        self._socket.close()
        self._socket = fresh
        self._batch = RecvmmsgBuffers()
        self._reader = ModeratedReader(fresh, self._drain)


def _open_socket(channel: str) -> socket.socket:
    try:
        opened = socket.socket(socket.AF_CAN, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.CAN_RAW)
    except OSError as error:
        raise BusOpenError(
            f"this kernel has no SocketCAN: {error.strerror}",
            remedy="modprobe can_raw; or use another interface (`virtual` needs nothing)",
        ) from error
    try:
        opened.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        opened.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
        opened.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, 1)
        opened.setsockopt(socket.SOL_CAN_RAW, _CAN_RAW_ERR_FILTER, struct.pack("=I", _ALL_ERRORS))
        _enlarge(opened)
        opened.bind((channel,))
    except OSError as error:
        opened.close()
        if _is_no_can_link(channel):
            what, remedy = f"cannot open {channel}: it is no CAN link", "Name one that `ip link show type can` lists"
            raise BusOpenError(what, remedy=f"{remedy}, or `ip link show type vcan`") from error
        raise BusOpenError(
            f"cannot open {channel}: {error.strerror}",
            remedy=f"`ip link show {channel}` must list it; a real one: ip link set {channel} up type can bitrate "
            f"1000000 restart-ms 100; one for tests: ip link add dev {channel} type vcan && ip link set up {channel}",
        ) from error
    return opened


def _is_no_can_link(channel: str) -> bool:
    """Return whether there is a network link of this name, of another type than CAN."""
    try:
        return (NETWORK_LINKS / channel / "type").read_text(encoding="ascii").strip() != CAN_LINK_TYPE
    except OSError:
        return False


def _enlarge(opened: socket.socket) -> None:
    """Ask for a receive buffer of some thousand frames; the usual limit (net.core.rmem_max) gives a few hundred."""
    try:
        opened.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _RECEIVE_BUFFER_BYTES)
    except PermissionError:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
