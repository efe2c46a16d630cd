"""Virtual rover, daemon and commands, each a process, on vcan0 and with a broker: the fixture `stack`."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pytest
from broker import Mosquitto, mosquitto_program

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

CHANNEL = "vcan0"
TIMEOUT_S = 60


def until(condition: Callable[[], object], what: Callable[[], str] | str, seconds: float = TIMEOUT_S) -> None:
    """Wait until a condition holds; after `seconds` fail with `what`, which describes the condition."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {seconds:g} s: {what if isinstance(what, str) else what()}")
        time.sleep(0.05)


@dataclass
class Stack:
    """Starts and stops the processes; their output goes to `NAME.log` in `folder`."""

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
        """Write the daemon's rover.toml."""
        self.configuration.write_text(
            f"""
[bus]
channel = "{self.channel}"
[sync]
rate_Hz = {self.rate_Hz}
[nodes]
heartbeat_timeout_ms = 3000  # the guest has one processor: starting a process may block the others for 1 s
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
        """Start `regolithd` with these arguments as process `name`; wait for an earlier one of that name."""
        command = [sys.executable, "-m", "regolithd", *arguments]
        if before := self.processes.get(name):
            before.wait(TIMEOUT_S)
        environment = os.environ | {"PYTHONUNBUFFERED": "1", "COLUMNS": "120"}
        with (self.folder / f"{name}.log").open("a") as log:
            process = subprocess.Popen(command, stdout=log, stderr=log, text=True, env=environment, cwd=self.folder)
        self.processes[name] = process
        return process

    def output(self, name: str) -> str:
        """Return the output of a process so far."""
        path = self.folder / f"{name}.log"
        return path.read_text() if path.exists() else ""

    def start_rover(self) -> None:
        """Start the virtual rover and wait until it is on the bus."""
        control = str(self.folder / "rover.sock")
        self.spawn("rover", "bench", "--channel", self.channel, "--no-noise", "--control", control)
        until(lambda: "ready" in self.output("rover"), "the virtual rover is ready")

    def inject_fault(self, command: str) -> None:
        """Inject a fault into the virtual rover, such as `off 3`."""
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(self.folder / "rover.sock"))
            connection.sendall(f"{command}\n".encode())
            answer = connection.recv(4096).decode()
        assert not answer.startswith("error"), answer

    def start_daemon(self) -> None:
        """Start the daemon, and wait until every node is operational."""
        self.write_configuration()
        self.spawn("daemon", "run", "--config", str(self.configuration))
        until(self.ready, lambda: f"every node is operational: {self.output('daemon')}")

    def recover(self) -> None:
        """Start the daemon if it does not run, and wait until every node is operational."""
        daemon = self.processes.get("daemon")
        if daemon is None or daemon.poll() is not None:
            self.start_daemon()
        until(self.ready, lambda: f"every node is operational again: {self.output('daemon')}")

    def ready(self) -> bool:
        """Return whether the daemon answers and every node is operational."""
        try:
            nodes = self.ask({"command": "status"})["nodes"]
        except OSError:
            return False
        return bool(nodes) and all(node["phase"] == "operational" for node in nodes)

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """Return the daemon's answer to one request over the control socket."""
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(self.folder / "control.sock"))  # waits while others wait to be accepted
            connection.settimeout(TIMEOUT_S)
            connection.sendall(json.dumps(request).encode() + b"\n")
            with connection.makefile() as lines:
                answer: dict[str, Any] = json.loads(lines.readline())
        return answer

    def stop(self, name: str) -> int:
        """Stop a process by SIGTERM and return its exit status."""
        process = self.processes.pop(name)
        process.terminate()
        return process.wait(TIMEOUT_S)

    def end(self) -> None:
        """Kill and wait for all processes."""
        for process in self.processes.values():
            if process.poll() is None:
                process.kill()
            process.wait()
        self.processes.clear()


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """A broker and a virtual rover for all tests of a module; the daemon is configured and does not run yet."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    folder = tmp_path_factory.mktemp("stack")
    broker = Mosquitto(folder)
    stack = Stack(folder, CHANNEL, broker.port)
    stack.write_configuration()
    try:
        broker.start()
        stack.start_rover()
        yield stack
    finally:
        stack.end()
        broker.stop()
