"""Daemon, virtual rover and broker as processes, with their observers and what is to be checked of them."""

from __future__ import annotations

import asyncio
import json
import os
import socket
import struct
import subprocess
import threading
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from broker import Mosquitto
from chaos_observers import CAN_FRAME, STANDSTILL_RAD_S, BusObserver, MessageObserver
from stack import CHANNEL, Stack, until

from regolithd.daemon.publish.segment import Segment

if TYPE_CHECKING:
    from pathlib import Path

    import paho.mqtt.client as mqtt
    from chaos_observers import Filler, Sender, Snapshot

RATE_HZ = 10.0
NORMAL_SNAPSHOTS = 10
NORMAL_TIMEOUT_S = 120.0
HEARD_TIMEOUT_S = 10.0
SPEED_COUNTS_S = 2.0
"""Age at which a speed says nothing any more: twenty SYNCs."""
DISK = "size=48M"
BROKER = (
    "allow_anonymous true\npersistence true\npersistence_location {folder}/\nmax_queued_messages 100000\n"
    "max_inflight_messages 100\nset_tcp_nodelay true\n"
)
ACTUAL_VELOCITY = b"\x40\x6c\x60\x00" + bytes(4)  # SDO upload of 0x606C


@dataclass
class Rig:
    """Everything that runs; `problems` are the violations of invariants so far."""

    stack: Stack
    broker: Mosquitto
    bus: BusObserver
    messages: MessageObserver
    problems: list[str] = field(default_factory=list)
    queued: set[tuple[str, int]] = field(default_factory=set)
    sigterm_s: list[float] = field(default_factory=list)
    crowd: list[socket.socket] = field(default_factory=list)
    sender: Sender | None = None
    filler: Filler | None = None
    intruder: mqtt.Client | None = None
    client: socket.socket | None = None
    sent: int = 0
    checked: int = 0
    compared: int = 0

    @property
    def daemon(self) -> subprocess.Popen[str]:
        """The daemon's process."""
        return self.stack.processes["daemon"]

    @property
    def disk(self) -> Path:
        """The folder of store and recordings."""
        return self.stack.folder / "disk"

    def close(self) -> None:
        """End all processes; show the daemon's last lines where something did not hold."""
        self.stack.end()
        self.broker.stop()
        if self.problems:
            print(self.stack.output("daemon")[-3000:])
        if os.path.ismount(self.disk):
            subprocess.run(["umount", "--lazy", self.disk], check=True)

    def check(self, holds: bool, text: str) -> None:
        """Count an invariant, and note it where it does not hold."""
        self.checked += 1
        if not holds:
            self.problems.append(text)

    def start_daemon(self) -> None:
        """Start the daemon, and do not wait for it."""
        self.stack.spawn("daemon", "run", "--config", str(self.stack.configuration))

    def note_queued(self) -> None:
        """Note the snapshots that wait in the store of a daemon that does not run: all of them must arrive."""
        for path in (self.disk / "spool").glob("*.segment"):
            for record in Segment.found(path).read():
                if record.topic == "snapshot":
                    message = json.loads(record.payload)
                    self.queued.add((message["session"], message["sequence"]))

    def drive(self) -> bool:
        """Begin a traverse, and return whether the wheels turn; the last one may still be ending."""
        self.client = socket.socket(socket.AF_UNIX)
        self.client.connect(str(self.stack.folder / "control.sock"))
        self.client.settimeout(10)
        deadline = time.monotonic() + 10
        answer = b""
        while b"accepted" not in answer and time.monotonic() < deadline:
            self.client.sendall(b'{"command": "traverse", "distance_m": 10.0, "speed_m_s": 0.02}\n')
            answer = self.client.recv(4096)
            time.sleep(0.2)
        if b"accepted" not in answer:
            self.problems.append(f"traverse: {answer[:200]!r}")
            return False
        while time.monotonic() < deadline and not self.turning():
            time.sleep(0.1)
        return self.turning()

    def end_drive(self) -> None:
        """Disconnect the client that commanded the traverse: the wheels must stop."""
        if self.client is not None:
            self.client.close()
            self.client = None

    def turning(self) -> bool:
        """Return whether any wheel turns, as its PDOs say; a drive without power sends none, and stands still."""
        now = time.monotonic()
        return any(abs(speed) > STANDSTILL_RAD_S for speed, at in self.bus.speeds.values() if now - at < SPEED_COUNTS_S)

    def stopped_by_sdo(self) -> bool:
        """Return whether all drives that answer stand still: read by SDO, while no master runs."""
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
            bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, struct.pack("=II", 0x580, 0x780))
            bus.bind((self.stack.channel,))
            bus.settimeout(1.0)
            for drive in range(1, 7):
                bus.send(CAN_FRAME.pack(0x600 + drive, 8, ACTUAL_VELOCITY))
                try:
                    data = CAN_FRAME.unpack(bus.recv(16))[2]
                except TimeoutError:
                    continue
                if data[0] == 0x43 and abs(struct.unpack("<i", data[4:])[0]) > 1:
                    return False
        return True

    def normal(self, since_s: float) -> bool:
        """Return whether the newest snapshots came since then: live, in a row, with every wheel measured."""
        latest = self.messages.snapshots[-NORMAL_SNAPSHOTS:]
        return (
            len(latest) == NORMAL_SNAPSHOTS
            and latest[0].arrived_s > since_s
            and all(not each.late and each.measured for each in latest)
            and [each.sequence for each in latest]
            == list(range(latest[0].sequence, latest[0].sequence + NORMAL_SNAPSHOTS))
            and self.stack.ready()
        )

    def until_normal(self) -> float | None:
        """Wait until everything is normal again; return the time that it took, without the snapshots that show it."""
        begun = time.monotonic()
        while time.monotonic() - begun < NORMAL_TIMEOUT_S:
            if self.normal(begun):
                return self.messages.snapshots[-NORMAL_SNAPSHOTS].arrived_s - begun
            time.sleep(0.05)
        return None

    def until_heard(self, topic: str, since_s: float, **fields: object) -> bool:
        """Wait for a message as `MessageObserver.heard` does: what was queued meanwhile comes behind live snapshots."""
        begun = time.monotonic()
        while not self.messages.heard(topic, since_s, **fields):
            if time.monotonic() - begun > HEARD_TIMEOUT_S:
                return False
            time.sleep(0.05)
        return True

    def compare_with_bus(self, snapshots: list[Snapshot], what: str = "") -> None:
        """Check that each published value came on the bus between this SYNC and the next."""
        for snapshot in snapshots:
            window = self.bus.windows.get(snapshot.time_us)
            if window is None:
                continue  # from before the observer, or while the link was down
            for name, six in snapshot.values.items():
                for wheel, value in enumerate(six):
                    if value is not None:
                        self.compared += 1
                        seen = window.values.get((name, wheel), set())
                        self.check(
                            value in seen,
                            f"{name} of wheel {wheel + 1} at {snapshot.time_us}: {value} not on the bus {what}",
                        )

    def check_order(self) -> None:
        """Check order, completeness, repetitions, and that everything queued at a kill has arrived."""
        first: dict[str, list[int]] = defaultdict(list)
        times: Counter[tuple[str, int]] = Counter()
        for each in self.messages.snapshots:
            key = (each.session, each.sequence)
            if times[key]:
                self.check(each.late or each.repeated_by_broker, f"a repetition is not marked: {key}")
            else:
                first[each.session].append(each.sequence)
            times[key] += 1
        for session, sequences in first.items():
            self.check(sequences == sorted(sequences), f"out of order in session {session}")
            missing = set(range(max(sequences) + 1)) - set(sequences)
            self.check(not missing, f"session {session} lacks {sorted(missing)[:10]} of {max(sequences) + 1}")
        lost = self.queued - times.keys()
        self.check(not lost, f"queued and lost: {sorted(lost)[:10]}")
        self.check(not self.messages.undecodable, f"not JSON: {self.messages.undecodable[:2]}")


def configuration(folder: Path, port: int) -> str:
    """Return the daemon's rover.toml."""
    return f"""
[bus]
channel = "{CHANNEL}"
[sync]
rate_Hz = {RATE_HZ}
[nodes]
heartbeat_timeout_ms = 3000  # the guest has one processor: starting a process may block the others for 1 s
[recording]
directory = "{folder}/disk/recordings"
limit_MB = 30
file_minutes = 1
[mqtt]
host = "127.0.0.1"
port = {port}
spool_directory = "{folder}/disk/spool"
[control]
socket = "{folder}/control.sock"
group = "{os.getgid()}"
"""


def new_rig(folder: Path) -> Rig:
    """Start broker, rover and daemon; the folder of store and recordings is a small disk of its own where possible."""
    (folder / "disk").mkdir()
    if os.geteuid() == 0:
        subprocess.run(["mount", "-t", "tmpfs", "-o", DISK, "tmpfs", folder / "disk"], check=True)
    broker = Mosquitto(folder)
    broker.settings = BROKER.format(folder=folder)
    broker.start()
    stack = Stack(folder, CHANNEL, broker.port, RATE_HZ)
    stack.start_rover()
    stack.configuration.write_text(configuration(folder, broker.port))
    rig = Rig(stack, broker, BusObserver(CHANNEL), MessageObserver(broker.port))
    threading.Thread(target=lambda: asyncio.run(rig.messages.run()), daemon=True).start()
    until(rig.messages.ready.is_set, "the subscriber is connected")
    rig.start_daemon()
    try:
        until(stack.ready, lambda: f"every node is operational: {stack.output('daemon')}")
    except AssertionError:
        rig.close()  # a mounted disk would hide why
        raise
    return rig
