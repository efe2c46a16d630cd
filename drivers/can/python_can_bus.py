"""Every python-can interface except SocketCAN, read by one thread.

python-can has a blocking `recv` for every interface and a file descriptor for few, so one thread per bus blocks in
`recv` and passes the frames to the event loop. It is the only thread in the drivers. Times are python-can's: the
adapter's where it stamps frames, else the computer's, with the resolution of a float (0.2 µs).
"""

from __future__ import annotations

import asyncio
import threading
import time
from contextlib import suppress
from typing import Any

import can

from regolithd.drivers.can.bus import Bus, BusState
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.errors import BusDownError, BusFullError, BusOpenError

_RECV_TIMEOUT_S = 0.05  # also the longest time that closing takes
_SEND_TIMEOUT_S = 0.1
_REOPEN_S = 1.0
_MOST_AT_ONCE = 1000  # frames in one batch


class PythonCanBus(Bus):
    """A bus that python-can opens."""

    def __init__(self, interface: str, channel: str, *, bitrate: int | None = None) -> None:
        super().__init__(interface, channel)
        self._settings: dict[str, Any] = {} if bitrate is None else {"bitrate": bitrate}
        self._bus = self._open()
        self._loop = asyncio.get_running_loop()
        self._may_read = threading.Event()
        self._may_read.set()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._read, name=f"can-{interface}-{channel}", daemon=True)
        self._thread.start()

    async def send(self, frame: Frame) -> None:
        """See `Bus.send`."""
        message = can.Message(
            arbitration_id=frame.can_id,
            data=frame.data,
            is_extended_id=frame.extended,
            is_remote_frame=frame.remote,
        )
        try:
            self._bus.send(message, timeout=_SEND_TIMEOUT_S)
        except can.CanTimeoutError as error:
            self.counters.transmit_failures += 1
            raise BusFullError(f"{self.interface} {self.channel}: {error}") from error
        except (can.CanError, OSError) as error:
            self.counters.transmit_failures += 1
            raise BusDownError(f"{self.interface} {self.channel}: {error}") from error
        self.counters.sent += 1

    def close(self) -> None:
        """Stop the thread and close the adapter."""
        self._closing.set()
        self._may_read.set()
        self._thread.join(timeout=1.0)
        with suppress(can.CanError, OSError):
            self._bus.shutdown()

    def pause_reading(self) -> None:
        """Stop reading; frames stay in the adapter's own queue."""
        self._may_read.clear()

    def resume_reading(self) -> None:
        """Resume reading."""
        self._may_read.set()

    def _open(self) -> can.BusABC:
        try:
            return can.Bus(channel=self.channel, interface=self.interface, receive_own_messages=True, **self._settings)
        except (can.CanError, OSError, ValueError, TypeError) as error:
            raise BusOpenError(
                f"cannot open channel {self.channel!r} of interface {self.interface!r}: {error}",
                remedy="Is the adapter plugged in? These interfaces there are: "
                + ", ".join(sorted(can.VALID_INTERFACES)),
            ) from error

    def _read(self) -> None:
        """Read until closed (runs in the thread); an adapter that was unplugged is opened again."""
        while not self._closing.is_set():
            self._may_read.wait()
            try:
                batch = self._read_batch()
            except (can.CanError, OSError):
                self._reopen()
            else:
                if batch:
                    self._call(self._take, batch)

    def _read_batch(self) -> list[Frame]:
        """Wait for one frame, then read all that are available."""
        message = self._bus.recv(_RECV_TIMEOUT_S)
        batch = []
        while message is not None:
            batch.append(_frame(message))
            message = self._bus.recv(0) if len(batch) < _MOST_AT_ONCE else None
        return batch

    def _reopen(self) -> None:
        self._call(self.change_state, BusState.DOWN)
        with suppress(can.CanError, OSError):
            self._bus.shutdown()
        while not self._closing.wait(_REOPEN_S):
            try:
                self._bus = self._open()
            except BusOpenError:
                continue
            self._call(self.change_state, BusState.ACTIVE)
            return

    def _take(self, batch: list[Frame]) -> None:
        for frame in batch:
            if frame.error:
                self.counters.errors["adapter"] += 1  # python-can does not report the class
        self.deliver(batch)

    def _call(self, function: object, *arguments: object) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(function, *arguments)  # type: ignore[arg-type]


def _frame(message: can.Message) -> Frame:
    return Frame(
        time_ns=round(message.timestamp * 1e9) or time.time_ns(),
        can_id=message.arbitration_id,
        data=bytes(message.data),
        extended=message.is_extended_id,
        remote=message.is_remote_frame,
        error=message.is_error_frame,
        sent=not message.is_rx,
    )
