"""A real mosquitto on a free loopback port, to be stopped, frozen and started again as a test needs it."""

from __future__ import annotations

import contextlib
import shutil
import signal
import socket
import subprocess
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

START_s = 20


def mosquitto_program() -> str | None:
    """Find the broker: Debian installs it where only root looks."""
    return shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")


def unused_port() -> int:
    """Return a TCP port of the loopback interface that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class Mosquitto:
    """A broker that keeps its port through restarts; `settings` are further lines of its configuration.

    Its calls block for some tens of milliseconds; where a test's loop must go on meanwhile, use `asyncio.to_thread`.
    """

    folder: Path
    port: int = field(default_factory=unused_port)
    settings: str = "allow_anonymous true\n"
    host: str = "127.0.0.1"
    process: subprocess.Popen[bytes] | None = None

    @property
    def log(self) -> str:
        """What the broker has written so far."""
        path = self.folder / "mosquitto.log"
        return path.read_text() if path.exists() else ""

    def start(self) -> None:
        """Start the broker and return once it accepts connections; does nothing if it runs."""
        if self.process is not None:
            return
        program = mosquitto_program()
        assert program is not None
        configuration = self.folder / "mosquitto.conf"
        # Started by root it would become another user, who may not read the test's folder.
        configuration.write_text(f"listener {self.port} {self.host}\nuser root\n{self.settings}")
        with (self.folder / "mosquitto.log").open("ab") as log:
            self.process = subprocess.Popen(
                [program, "-c", configuration], stdout=log, stderr=log, stdin=subprocess.DEVNULL
            )
        deadline = time.monotonic() + START_s
        while True:
            with contextlib.suppress(ConnectionRefusedError), socket.create_connection((self.host, self.port), 1):
                return
            if self.process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f"mosquitto did not start:\n{self.log}")
            time.sleep(0.02)

    def stop(self) -> None:
        """Stop the broker as its service manager would; frozen or not running is no hindrance."""
        if self.process is not None:
            self.thaw()
            self.process.terminate()
            self.process.wait(START_s)
            self.process = None

    def kill(self) -> None:
        """End the broker as a power cut would: connections are reset, nothing is said."""
        if self.process is not None:
            self.process.kill()
            self.process.wait(START_s)
            self.process = None

    def freeze(self) -> None:
        """Keep the connections open while nothing answers any more, as a hung broker does."""
        if self.process is not None:
            self.process.send_signal(signal.SIGSTOP)

    def thaw(self) -> None:
        """Let a frozen broker go on."""
        if self.process is not None:
            self.process.send_signal(signal.SIGCONT)
