"""The whole of it in processes of their own: virtual rover, daemon, and whoever commands it, over one CAN link."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from broker import Mosquitto, mosquitto_program

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 60


def until(happened: Callable[[], object], what: Callable[[], str] | str, seconds: float = PATIENCE_S) -> None:
    """Wait for something to happen, with a deadline that only a broken program misses; `what` says what did not."""
    deadline = time.monotonic() + seconds
    while not happened():
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {seconds:g} s: {what if isinstance(what, str) else what()}")
        time.sleep(0.05)


@dataclass
class Stack:
    """Starts and stops the processes; what they say goes to files in `folder`."""

    folder: Path
    channel: str
    port: int
    rate_Hz: float = 10.0
    processes: dict[str, subprocess.Popen[str]] = field(default_factory=dict)

    @property
    def configuration(self) -> Path:
        """The daemon's rover.toml."""
        return self.folder / "rover.toml"

    def write_configuration(self) -> None:
        """Write it."""
        self.configuration.write_text(
            f"""
[bus]
channel = "{self.channel}"
[sync]
rate_Hz = {self.rate_Hz}
[nodes]
heartbeat_timeout_ms = 3000  # the guest has one processor: starting a command may hold everybody else up for a second
[recording]
enabled = false
[mqtt]
host = "127.0.0.1"
port = {self.port}
spool_directory = "{self.folder}/spool"
[control]
socket = "{self.folder}/control.sock"
group = "{os.getgid()}"
"""
        )

    def spawn(self, name: str, *arguments: str) -> subprocess.Popen[str]:
        """Start `regolithd` with these arguments under a name."""
        command = [sys.executable, "-m", "regolithd", *arguments]
        if before := self.processes.get(name):
            before.wait(PATIENCE_S)
        environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1", "COLUMNS": "120"}
        with (self.folder / f"{name}.log").open("a") as log:
            process = subprocess.Popen(command, stdout=log, stderr=log, text=True, env=environment, cwd=self.folder)
        self.processes[name] = process
        return process

    def said(self, name: str) -> str:
        """Return what a process has said so far."""
        path = self.folder / f"{name}.log"
        return path.read_text() if path.exists() else ""

    def start_rover(self) -> None:
        """Put the virtual rover on the bus."""
        control = str(self.folder / "rover.sock")
        self.spawn("rover", "bench", "--channel", self.channel, "--no-noise", "--control", control)
        until(lambda: "ready" in self.said("rover"), "the virtual rover is ready")

    def tell_rover(self, words: str) -> None:
        """Have something go wrong on the virtual rover."""
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(self.folder / "rover.sock"))
            connection.sendall(f"{words}\n".encode())
            answer = connection.recv(4096).decode()
        assert not answer.startswith("error"), answer

    def start_daemon(self) -> None:
        """Start the daemon, and wait until every node is operational."""
        self.write_configuration()
        self.spawn("daemon", "run", "--config", str(self.configuration))
        until(self.ready, lambda: f"every node is operational: {self.said('daemon')}")

    def recover(self) -> None:
        """Bring everything back after whatever a test did: the daemon runs, and every node is operational."""
        daemon = self.processes.get("daemon")
        if daemon is None or daemon.poll() is not None:
            self.start_daemon()
        until(self.ready, lambda: f"every node is operational again: {self.said('daemon')}")

    def ready(self) -> bool:
        """Whether the daemon answers and every node is operational."""
        try:
            nodes = self.ask({"command": "status"})["nodes"]
        except OSError:
            return False
        return bool(nodes) and all(node["phase"] == "operational" for node in nodes)

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """Return the daemon's answer to one request over the control socket."""
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(PATIENCE_S)
            connection.connect(str(self.folder / "control.sock"))
            connection.sendall(json.dumps(request).encode() + b"\n")
            with connection.makefile() as lines:
                answer: dict[str, Any] = json.loads(lines.readline())
        return answer

    def stop(self, name: str) -> int:
        """Stop a process as its service manager would, and return its exit status."""
        process = self.processes.pop(name)
        process.terminate()
        return process.wait(PATIENCE_S)

    def end(self) -> None:
        """Leave nothing running."""
        for process in self.processes.values():
            if process.poll() is None:
                process.kill()
            process.wait()
        self.processes.clear()


@contextlib.contextmanager
def stack_on(channel: str, folder: Path) -> Iterator[Stack]:
    """A broker and a virtual rover, and the configuration of a daemon that does not run yet; at the end, nothing."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    broker = Mosquitto(folder)
    stack = Stack(folder, channel, broker.port)
    stack.write_configuration()
    try:
        broker.start()
        stack.start_rover()
        yield stack
    finally:
        stack.end()
        broker.stop()
