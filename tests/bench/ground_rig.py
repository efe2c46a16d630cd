"""A ground process, and a driving daemon with its virtual rover; the broker between them is given."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from broker import Mosquitto, unused_port
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.examples import example
from regolithd.daemon.messages.header import time_fields

if TYPE_CHECKING:
    from collections.abc import Callable

DAEMON = Path(__file__).with_name("driving_daemon.py")
TIMEOUT_S = 40
EXAMPLES = {channel.name: example(channel) for channel in CHANNELS}


def chromium() -> str | None:
    """Return the path of Chromium; None if there is none."""
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def until(condition: Callable[[], object], what: Callable[[], str] | str, seconds: float = TIMEOUT_S) -> Any:
    """Wait until a condition holds and return its value; after `seconds` fail with `what`."""
    deadline = time.monotonic() + seconds
    while not (value := condition()):
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {seconds:g} s: {what if isinstance(what, str) else what()}")
        time.sleep(0.05)
    return value


@dataclass
class GroundRig:
    """The processes; their output goes to `NAME.log` in `folder`. `page` is further lines of the ground's [page]."""

    folder: Path
    broker: Mosquitto
    page: str = ""
    scheme: str = "http"
    rover: str = "kapvik"
    port: int = field(default_factory=unused_port)
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    @property
    def url(self) -> str:
        """The page's address."""
        return f"{self.scheme}://localhost:{self.port}"

    @property
    def database(self) -> Path:
        """The ground's database."""
        return self.folder / "data/ground.sqlite"

    def spawn(self, name: str, *command: str | Path) -> None:
        """Start a process."""
        with (self.folder / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                [sys.executable, *command], stdout=log, stderr=log, cwd=self.folder, stdin=subprocess.DEVNULL
            )

    def output(self, name: str) -> str:
        """Return the output of a process so far."""
        return (self.folder / f"{name}.log").read_text()

    def start_ground(self) -> None:
        """Start the ground and wait until its page answers and it is connected to the broker."""
        (self.folder / "ground.toml").write_text(
            f"""
[mqtt]
host = "127.0.0.1"
port = {self.broker.port}
[store]
directory = "data"
[page]
port = {self.port}
{self.page}
"""
        )
        before = self.output("ground").count("connected to") if (self.folder / "ground.log").exists() else 0
        self.spawn("ground", "-m", "regolithd", "ground", "--config", "ground.toml")
        until(lambda: self.output("ground").count("connected to") > before, lambda: self.output("ground"))

    def start_daemon(self, scenario: str = "") -> None:
        """Start the daemon and its virtual rover, and wait until the wheels turn."""
        (self.folder / "scenario.toml").write_text(scenario)
        (self.folder / "rover.toml").write_text(
            f"""
[rover]
name = "{self.rover}"
[bus]
interface = "virtual"
channel = "ground"
[sync]
rate_Hz = 10
[nodes]
inclinometer = 21
ground_speed = 22
[drivetrain]
no_load_current_A = 0.037
viscous_current_A_s_per_rad = 4e-5
gain_relative_std = 0.03
no_load_current_std_A = 0.001
[posterior]
window_s = 8.0
[recording]
enabled = false
[mqtt]
host = "127.0.0.1"
port = {self.broker.port}
keepalive_s = 2
spool_directory = "spool"
[control]
socket = "control.sock"
group = "{os.getgid()}"
"""
        )
        self.spawn("daemon", DAEMON, "rover.toml", "scenario.toml")
        until(lambda: "driving" in self.output("daemon"), lambda: self.output("daemon"))

    def inject_fault(self, command: str) -> None:
        """Inject a fault into the virtual rover, such as `off 13`."""
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(self.folder / "rover.sock"))
            connection.sendall(f"{command}\n".encode())
            answer = connection.recv(4096).decode()
        assert not answer.startswith("error"), answer

    def stop(self, name: str, number: int = signal.SIGTERM) -> int:
        """Stop a process and return its exit status."""
        process = self.processes.pop(name)
        process.send_signal(number)
        return process.wait(TIMEOUT_S)

    def end(self) -> None:
        """Kill all processes."""
        for process in self.processes.values():
            with suppress(ProcessLookupError):
                process.kill()
            process.wait()

    def get(self, path: str) -> Any:
        """Return the JSON at a path."""
        with urllib.request.urlopen(self.url + path, timeout=20) as answer:
            return json.load(answer)

    def post(self, path: str, body: dict[str, Any], **headers: str) -> tuple[int, dict[str, Any]]:
        """Return status and content of the answer to a POST."""
        request = urllib.request.Request(self.url + path, json.dumps(body).encode(), headers, method="POST")
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as error:
            text = error.read().decode()
            return error.code, json.loads(text) if text.startswith("{") else {"error": text}

    def publish(
        self, topic: str, channel: str, rover: str = "other", *, now_ns: int | None = None, **fields: Any
    ) -> None:
        """Publish an example message of another rover, with these fields."""
        moment = time_fields(time.time_ns() if now_ns is None else now_ns)
        message = EXAMPLES[channel] | moment | {"session": "20261122T000000Z-aaaa"} | fields
        client = Client(CallbackAPIVersion.VERSION2)
        client.connect("127.0.0.1", self.broker.port)
        client.loop_start()
        client.publish(f"regolith/{rover}/{topic}", json.dumps(message), qos=1).wait_for_publish(10)
        client.disconnect()
        client.loop_stop()
