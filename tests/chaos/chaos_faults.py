"""The faults: how each begins and ends, what must be heard of it, and whether it must stop the wheels."""

from __future__ import annotations

import itertools
import os
import random
import shutil
import signal
import socket
import subprocess
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import paho.mqtt.client as mqtt
from chaos_observers import Filler, Sender

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from chaos_rig import Rig

Heard = tuple[str, dict[str, object]]
CELL, DRIVE = 13, 2
EXTENDED = 0x80000000
CAN, BROKER, DAEMON, COMPUTER = "CAN", "broker", "daemon", "computer"
SIGTERM_TIMEOUT_S = 5.0


@dataclass(frozen=True)
class Fault:
    """One kind of fault.

    `begin` and `end` act on the rig; `hold_s` is the shortest and longest time between them. `heard` is a topic with
    values, of which a message must come. `stops` says that wheels which turn must stop.
    """

    name: str
    kind: str
    hold_s: tuple[float, float]
    begin: Callable[[Rig], None]
    end: Callable[[Rig], None]
    heard: Heard | None = None
    stops: bool = False


def nothing(_rig: Rig) -> None:
    """Do nothing."""


def command(*lines: str) -> Callable[[Rig], None]:
    """Return a function that gives commands to the virtual rover."""

    def give(rig: Rig) -> None:
        for line in lines:
            rig.stack.inject_fault(line)

    return give


def sending(frames: Callable[[], Iterator[tuple[int, bytes]]], pause_s: float = 0.0) -> Callable[[Rig], None]:
    """Return a function that begins to send frames."""

    def begin(rig: Rig) -> None:
        rig.sender = Sender(rig.stack.channel, frames(), pause_s)

    return begin


def end_sending(rig: Rig) -> None:
    """Stop sending frames."""
    assert rig.sender is not None
    rig.sender.end()
    rig.sent += rig.sender.sent


def babble() -> Iterator[tuple[int, bytes]]:
    """Yield EMCY messages of a load cell without end."""
    for number in itertools.count():
        yield 0x080 + CELL, b"\x00\x50\x01" + number.to_bytes(5, "little")


def garbage() -> Iterator[tuple[int, bytes]]:
    """Yield frames of nodes that are not there, 29-bit identifiers, and PDOs of a wrong length."""
    chance = random.Random(1)
    while True:
        data = chance.randbytes(chance.randrange(9))
        match chance.randrange(3):
            case 0:
                yield chance.choice((0x180, 0x280, 0x380, 0x480, 0x580, 0x700, 0x080)) + chance.randrange(64, 127), data
            case 1:
                yield EXTENDED | chance.randrange(1 << 29), data
            case _:
                yield 0x180 + chance.choice((*range(1, 7), *range(11, 17))), data[:1]


def second_sync() -> Iterator[tuple[int, bytes]]:
    """Yield SYNCs."""
    return itertools.repeat((0x080, b""))


def second_cell() -> Iterator[tuple[int, bytes]]:
    """Yield PDOs as load cell 13 sends them."""
    return itertools.repeat((0x180 + CELL, b"\x10\x27\x00\x00\x00"))


def link(state: str) -> Callable[[Rig], None]:
    """Return a function that sets the link up or down."""
    return lambda rig: subprocess.run(["ip", "link", "set", rig.stack.channel, state], check=True) and None


def kill(rig: Rig) -> None:
    """Kill the daemon; what its store holds must be delivered later."""
    rig.daemon.kill()
    rig.daemon.wait()
    rig.note_queued()


def terminate(rig: Rig) -> None:
    """Stop the daemon by SIGTERM: it must end in time, with status 0."""
    begun = time.monotonic()
    rig.daemon.terminate()
    with suppress(subprocess.TimeoutExpired):
        rig.daemon.wait(30)
    rig.check(rig.daemon.poll() == 0, f"SIGTERM: exit status {rig.daemon.poll()}")
    rig.sigterm_s.append(time.monotonic() - begun)
    rig.note_queued()


def start_daemon(rig: Rig) -> None:
    """Start the daemon again."""
    rig.start_daemon()


def take_over(rig: Rig) -> None:
    """Connect with the daemon's client identifier."""
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, client_id="regolithd-regolith-kapvik")
    client.connect("127.0.0.1", rig.stack.port)
    client.loop_start()
    rig.intruder = client


def give_back(rig: Rig) -> None:
    """Disconnect the client with the daemon's identifier."""
    assert rig.intruder is not None
    rig.intruder.disconnect()
    rig.intruder.loop_stop()


def fill_disk(rig: Rig) -> None:
    """Begin to fill the disk of store and recordings, and keep it full."""
    rig.filler = Filler(rig.disk / "filler")


def empty_disk(rig: Rig) -> None:
    """Free the disk."""
    assert rig.filler is not None
    rig.filler.end()


def set_clock(seconds: float) -> Callable[[Rig], None]:
    """Return a function that sets the clock by so many seconds."""
    return lambda _rig: time.clock_settime(time.CLOCK_REALTIME, time.time() + seconds)


def crowd(rig: Rig) -> None:
    """Open two hundred connections to the control socket with half a line each; `stop` must get through."""
    for _ in range(200):
        connection = socket.socket(socket.AF_UNIX)
        connection.settimeout(2)
        with suppress(OSError):
            connection.connect(str(rig.stack.folder / "control.sock"))
            connection.sendall(b'{"command": "st')
            rig.crowd.append(connection)
    begun = time.monotonic()
    answer = rig.stack.ask({"command": "stop"})
    rig.check(time.monotonic() - begun < 5 and "text" in answer, f"stop among 200 clients: {answer}")


def disperse(rig: Rig) -> None:
    """Close these connections."""
    for connection in rig.crowd:
        connection.close()
    rig.crowd.clear()


def alarm(name: str) -> Heard:
    """Return what is heard of an alarm."""
    return f"alarm/{name}", {"active": True}


FAULTS = (
    Fault("load cell off", CAN, (5, 7), command(f"off {CELL}"), command(f"on {CELL}"), alarm(f"node-{CELL}"), True),
    Fault("drive off", CAN, (5, 7), command(f"off {DRIVE}"), command(f"on {DRIVE}"), alarm(f"node-{DRIVE}"), True),
    Fault("node restarts", CAN, (3, 4), command(f"reset {CELL}"), nothing, ("event", {"kind": "node-lost"}), True),
    Fault("node leaves operational", CAN, (3, 4), command(f"leave {CELL}"), nothing, ("event", {"kind": "node-lost"})),
    Fault("drive fault", CAN, (6, 7), command(f"fault {DRIVE} 0x2310"), command(f"reset {DRIVE}"),
          ("emcy", {"node_id": DRIVE, "code": "0x2310"}), True),
    Fault("node sends no PDO", CAN, (2, 5), command(f"silent {CELL}"), command(f"clear {CELL}")),
    Fault("PDO late", CAN, (2, 5), command(f"slow {CELL} 96"), command(f"clear {CELL}")),
    Fault("PDO too short", CAN, (14, 16), command(f"short {CELL} 2"), command(f"clear {CELL}"), alarm("undecodable")),
    Fault("EMCY babble at bus speed", CAN, (4, 6), sending(babble), end_sending, alarm("event-rate")),
    Fault("random frames", CAN, (2, 5), sending(garbage, 0.002), end_sending, alarm("unexpected-node")),
    Fault("second SYNC producer", CAN, (3, 5), sending(second_sync, 0.14), end_sending, alarm("master")),
    Fault("two nodes with one id", CAN, (3, 5), sending(second_cell, 0.03), end_sending, alarm("node-id")),
    Fault("link down", CAN, (4, 6), link("down"), link("up"), alarm("bus"), True),
    Fault("daemon killed", DAEMON, (5, 7), kill, start_daemon, ("state", {"reason": "connection-lost"}), True),
    Fault("daemon stopped (SIGTERM)", DAEMON, (3, 4), terminate, start_daemon, ("state", {"reason": "stopped"}), True),
    Fault("daemon suspended", DAEMON, (5, 7), lambda rig: rig.daemon.send_signal(signal.SIGSTOP),
          lambda rig: rig.daemon.send_signal(signal.SIGCONT), None, True),
    Fault("broker stopped", BROKER, (3, 14), lambda rig: rig.broker.stop(), lambda rig: rig.broker.start()),
    Fault("broker frozen", BROKER, (3, 12), lambda rig: rig.broker.freeze(), lambda rig: rig.broker.thaw()),
    Fault("client identifier taken", BROKER, (3, 5), take_over, give_back),
    Fault("two hundred control clients", DAEMON, (1, 2), crowd, disperse),
    Fault("disk full", COMPUTER, (4, 8), fill_disk, empty_disk, alarm("recording")),
    Fault("clock back an hour", COMPUTER, (3, 5), set_clock(-3600), set_clock(3600), alarm("clock")),
)  # fmt: skip


def possible() -> tuple[Fault, ...]:
    """Return the faults that this computer allows: its clock is set in the guest alone, and a disk needs root."""
    guest = os.environ.get("VCAN_GUEST") == "uml"
    root = os.geteuid() == 0 and shutil.which("mount") is not None
    left_out = set() if guest else {"clock back an hour"}
    left_out |= set() if root else {"disk full", "link down"}
    return tuple(fault for fault in FAULTS if fault.name not in left_out)
