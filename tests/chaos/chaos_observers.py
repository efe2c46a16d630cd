"""Observers that know nothing of the daemon, of the CAN bus and the broker's messages; threads that disturb."""

from __future__ import annotations

import json
import os
import socket
import struct
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from subscriber import Subscriber

from regolithd.daemon.config.configuration import Configuration
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import Reading

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from paho.mqtt.client import MQTTMessage

CAN_FRAME = struct.Struct("=IB3x8s")
SO_TIMESTAMPNS, SCM_TIMESTAMPNS = 35, 35
SYNC = 0x080
EXTENDED_OR_REMOTE = 0xC0000000
QUANTITIES = ("motor_current_A", "motor_speed_rad_s", "load_N")
STANDSTILL_RAD_S = 1e-3
KEPT_S = 20.0
"""Windows of the bus that are kept for readings to be compared with: longer than a message is under way live."""


@dataclass(frozen=True, slots=True)
class Window:
    """What the bus carried from one SYNC to the next: values of each quantity and wheel (0–5)."""

    sync_ns: int
    values: dict[tuple[str, int], set[float]] = field(default_factory=dict)


class BusObserver:
    """Reads SYNCs and TPDOs from a raw socket of its own, in a thread."""

    def __init__(self, channel: str) -> None:
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        # SYNC, and the TPDOs 1 to 4: function codes 0x180, 0x280, 0x380, 0x480. A flood of EMCY stays in the kernel.
        filters = [(SYNC, 0x7FF), *((code, 0x780) for code in (0x180, 0x280, 0x380, 0x480))]
        packed = b"".join(struct.pack("=II", code, mask | EXTENDED_OR_REMOTE) for code, mask in filters)
        self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, packed)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self._socket.bind((channel,))
        nodes = Configuration().described()
        self._decoder = Decoder(nodes)
        self._wheels = {node.node_id: node.wheel for node in nodes}
        self.windows: dict[int, Window] = {}  # by the time of the SYNC in us
        self._order: deque[int] = deque()
        self._open: Window | None = None
        self.speeds: dict[int, tuple[float, float]] = {}  # of the motors, by wheel (0-5): newest, and when it came (s)
        self.syncs = 0
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        while True:
            try:
                data, ancillary, _, _ = self._socket.recvmsg(16, 64)
            except OSError:
                time.sleep(0.05)  # the link is down
                continue
            seconds, nanoseconds = struct.unpack("=qq", ancillary[0][2][:16])
            can_id, length, content = CAN_FRAME.unpack(data)
            self._take(Frame(seconds * 1_000_000_000 + nanoseconds, can_id & 0x7FF, content[:length]))

    def _take(self, frame: Frame) -> None:
        if frame.can_id == SYNC:
            self.syncs += 1
            self._open = Window(frame.time_ns)
            place = frame.time_ns // 1000
            self.windows[place] = self._open
            self._order.append(place)
            while len(self._order) > 4000:  # more than any outage of the broker lasts
                self.windows.pop(self._order.popleft(), None)
            return
        signal = self._decoder.decode(frame)
        if self._open is None or not isinstance(signal, Reading):
            return
        wheel = self._wheels[signal.node_id]
        if wheel is None:
            return
        for quantity, value in signal.values:
            self._open.values.setdefault((quantity.name, wheel), set()).add(value)
            if quantity.name == "motor_speed_rad_s":
                self.speeds[wheel] = (value, time.monotonic())


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A `snapshot` message as it arrived."""

    session: str
    sequence: int
    time_us: int
    late: bool
    repeated_by_broker: bool
    measured: bool
    values: dict[str, list[float | None]]
    arrived_s: float


@dataclass
class MessageObserver(Subscriber):
    """Keeps snapshots and alarms compactly, with the times of their arrival (CLOCK_MONOTONIC, s)."""

    snapshots: list[Snapshot] = field(default_factory=list)
    others: list[tuple[float, str, dict[str, Any]]] = field(default_factory=list)
    undecodable: list[bytes] = field(default_factory=list)

    def _take(self, _client: object, _userdata: object, message: MQTTMessage) -> None:
        topic = message.topic.removeprefix("regolith/kapvik/")
        now = time.monotonic()
        try:
            content = json.loads(message.payload)
        except ValueError:
            self.undecodable.append(bytes(message.payload))
            return
        if topic == "snapshot":
            self.snapshots.append(_snapshot(content, message.dup, now))
        elif topic.split("/")[0] in {"alarm", "state", "event", "emcy"}:
            self.others.append((now, topic, content))

    def heard(self, topic: str, since_s: float, **fields: object) -> bool:
        """Return whether a message of this topic has come since then with these values, or an alarm had them already.

        An alarm is published when it begins: one that a fault of the round before has left active begins only once.
        """
        messages = [(at, content) for at, name, content in self.others if name == topic]
        told = [content for at, content in messages if at >= since_s]
        if topic.startswith("alarm/"):
            told += [content for at, content in messages if at < since_s][-1:]
        return any(all(content.get(key) == value for key, value in fields.items()) for content in told)


def _snapshot(content: dict[str, Any], dup: bool, now_s: float) -> Snapshot:
    return Snapshot(
        content["session"],
        content["sequence"],
        _microseconds(content["time"]),
        content["late"],
        dup,
        all(content["measured"]),
        {name: content[name] for name in QUANTITIES},
        now_s,
    )


def _microseconds(text: str) -> int:
    """Return the microseconds since 1970 of an ISO 8601 time in UTC."""
    whole, _, fraction = text.rstrip("Z").partition(".")
    moment = time.strptime(whole, "%Y-%m-%dT%H:%M:%S")
    import calendar  # noqa: PLC0415

    return calendar.timegm(moment) * 1_000_000 + int(fraction.ljust(6, "0")[:6] or 0)


class Sender:
    """Sends frames from a thread, paced or as fast as the bus takes them, until `end`."""

    def __init__(self, channel: str, frames: Iterator[tuple[int, bytes]], pause_s: float) -> None:
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"")  # it reads nothing
        self._socket.bind((channel,))
        self._frames, self._pause_s, self._ended = frames, pause_s, False
        self.sent = 0
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def _send(self) -> None:
        for can_id, data in self._frames:
            if self._ended:
                return
            try:
                self._socket.send(CAN_FRAME.pack(can_id, len(data), data))
                self.sent += 1
            except OSError:
                time.sleep(0.001)
            if self._pause_s:
                time.sleep(self._pause_s)
            else:
                os.sched_yield()

    def end(self) -> None:
        """Stop sending."""
        self._ended = True
        self._thread.join(5)
        self._socket.close()


class Filler:
    """Fills a disk from a thread, to the last byte, until `end`.

    It takes at once what others free: the daemon deletes a file of its store that it cannot append to, up to 1 MB.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._fill, daemon=True)
        self._fill_up()
        self._thread.start()

    def _fill_up(self) -> None:
        for size in (65536, 512):
            with suppress(OSError), self._path.open("ab", buffering=0) as file:
                while file.write(bytes(size)):
                    continue

    def _fill(self) -> None:
        while not self._ended.wait(0.02):
            self._fill_up()

    def end(self) -> None:
        """Free the disk."""
        self._ended.set()
        self._thread.join(5)
        self._path.unlink()
