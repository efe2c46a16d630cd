"""A mosquitto broker on a free loopback port that tests can stop, freeze, kill and restart."""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
import signal
import socket
import subprocess
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

PROCESS_TIMEOUT_s = 20
PORTS = range(20_000, 30_000)
"""Below 32768, where Linux begins to choose the ports of outgoing connections."""
_first = os.getpid() * 97 % len(PORTS)
_ports = itertools.cycle([*PORTS[_first:], *PORTS[:_first]])


def mosquitto_program() -> str | None:
    """Return the path of mosquitto, also where Debian installs it (`/usr/sbin`); None if there is none."""
    return shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")


def unused_port() -> int:
    """Return an unused TCP port of the loopback interface.

    It is none of those that the kernel gives to outgoing connections, which could take it before it is used or while a
    broker is stopped; and processes that run tests at the same time begin at different ports.
    """
    for port in itertools.islice(_ports, len(PORTS)):
        with contextlib.suppress(OSError), socket.socket() as probe:
            probe.bind(("127.0.0.1", port))
            return port
    raise RuntimeError(f"no port of {PORTS} is free")


@dataclass
class Mosquitto:
    """A broker that keeps its port through restarts; `settings` are further lines of its configuration.

    The methods block for some tens of milliseconds; call them by `asyncio.to_thread` where the event loop must run on.
    """

    folder: Path
    port: int = field(default_factory=unused_port)
    settings: str = "allow_anonymous true\n"
    host: str = "127.0.0.1"
    own_listener: bool = True  # False: `settings` have the listener of `port`
    process: subprocess.Popen[bytes] | None = None

    @property
    def log(self) -> str:
        """The broker's log."""
        path = self.folder / "mosquitto.log"
        return path.read_text() if path.exists() else ""

    def start(self) -> None:
        """Start the broker and return once it accepts connections; do nothing if it runs."""
        if self.process is not None:
            return
        program = mosquitto_program()
        assert program is not None
        configuration = self.folder / "mosquitto.conf"
        # Started by root it would change to user mosquitto, who may not read the test's folder.
        listener = f"listener {self.port} {self.host}\n" if self.own_listener else ""
        configuration.write_text(f"{listener}user root\n{self.settings}")
        with (self.folder / "mosquitto.log").open("ab") as log:
            self.process = subprocess.Popen(
                [program, "-c", configuration], stdout=log, stderr=log, stdin=subprocess.DEVNULL
            )
        deadline = time.monotonic() + PROCESS_TIMEOUT_s
        while True:
            with contextlib.suppress(ConnectionRefusedError), socket.create_connection((self.host, self.port), 1):
                return
            if self.process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f"mosquitto did not start:\n{self.log}")
            time.sleep(0.02)

    def stop(self) -> None:
        """Stop the broker by SIGTERM, also if it is frozen; do nothing if it does not run."""
        if self.process is not None:
            self.thaw()
            self.process.terminate()
            self.process.wait(PROCESS_TIMEOUT_s)
            self.process = None

    def kill(self) -> None:
        """Kill the broker: connections are reset without a DISCONNECT."""
        if self.process is not None:
            self.process.kill()
            self.process.wait(PROCESS_TIMEOUT_s)
            self.process = None

    def freeze(self) -> None:
        """Suspend the broker: connections stay open and nothing answers, as with a hung broker."""
        if self.process is not None:
            self.process.send_signal(signal.SIGSTOP)

    def thaw(self) -> None:
        """Resume a frozen broker."""
        if self.process is not None:
            self.process.send_signal(signal.SIGCONT)
