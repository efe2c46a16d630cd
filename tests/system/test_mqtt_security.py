"""The whole daemon beside a client that may publish anything: nothing moves. And no secret is printed or stored."""

from __future__ import annotations

import asyncio
import grp
import json
import os
import re
import shutil
import subprocess
import sys
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import aiomqtt
import pytest
from broker import Mosquitto, mosquitto_program
from certificates import new_authority
from typer.main import get_command
from typer.testing import CliRunner

from regolithd.daemon.cli import app
from regolithd.daemon.control.protocol import StopRequest, TraverseRequest
from regolithd.daemon.messages.channels import CHANNELS

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator

ROOT = Path(__file__).resolve().parents[2]
SECRET = "correct-horse-battery-staple"
ROVER = f"""
[bus]
interface = "virtual"
channel = "strangers"
[recording]
directory = "recordings"
[control]
socket = "control.sock"
group = "{grp.getgrgid(os.getgid()).gr_name}"
[mqtt]
host = "127.0.0.1"
spool_directory = "spool"
keepalive_s = 2
"""
RECEIVED = re.compile(r"Received (\w+) from regolithd-regolith-kapvik")
SENT = re.compile(r"Sending (\w+) to regolithd-regolith-kapvik")


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    """A broker that lets everybody do anything, and logs every packet."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    broker = Mosquitto(tmp_path, settings="allow_anonymous true\nlog_type all\n")
    broker.start()
    yield broker
    broker.stop()


@asynccontextmanager
async def daemon(configuration: Path) -> AsyncIterator[asyncio.subprocess.Process]:
    """`regolithd run --verbose`, with its output in `daemon.log`; stopped by SIGTERM."""
    with (configuration.parent / "daemon.log").open("wb") as log:
        command = [sys.executable, "-m", "regolithd", "run", "--verbose", "--config", configuration]
        environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
        process = await asyncio.create_subprocess_exec(*command, stdout=log, stderr=log, env=environment)
        try:
            yield process
        finally:
            process.terminate()
            await process.wait()


async def snapshots(client: aiomqtt.Client, count: int) -> list[dict[str, Any]]:
    """Return the next snapshots."""
    found: list[dict[str, Any]] = []
    async with asyncio.timeout(30):
        async for message in client.messages:
            if str(message.topic).endswith("/snapshot"):
                found.append(json.loads(bytes(message.payload)))
            if len(found) == count:
                break
    return found


async def test_nothing_that_is_published_reaches_the_daemon(broker: Mosquitto, tmp_path: Path) -> None:
    """Commands of the control socket, on every topic, retained or not: the broker sends the daemon no message."""
    configuration = tmp_path / "rover.toml"
    configuration.write_text(f"{ROVER}port = {broker.port}\n")
    commands = [TraverseRequest(distance_m=1.0, speed_m_s=0.02).line(), StopRequest().line()]
    topics = [channel.address.replace("{", "").replace("}", "") for channel in CHANNELS]
    async with aiomqtt.Client("127.0.0.1", broker.port) as stranger, daemon(configuration):
        await stranger.subscribe("regolith/kapvik/snapshot", qos=1)
        await snapshots(stranger, 1)
        for topic in (*topics, "command", "control", "traverse", "cmd_vel", ""):
            for payload in commands:
                await stranger.publish(
                    f"regolith/kapvik/{topic}".rstrip("/"), payload, qos=1, retain=topic == "control"
                )
        await snapshots(stranger, 4)
    log = (tmp_path / "daemon.log").read_text()
    assert "traverse of" not in log
    assert not re.search("stop commanded", log)
    assert set(RECEIVED.findall(broker.log)) <= {"PUBLISH", "PINGREQ", "DISCONNECT"}
    assert set(SENT.findall(broker.log)) <= {"CONNACK", "PUBACK", "PINGRESP"}
    assert "PUBACK" in SENT.findall(broker.log)


async def test_no_secret_is_logged_printed_or_stored(broker: Mosquitto, tmp_path: Path) -> None:
    """Password and private key, with a broker that accepts and one that refuses: log, check, recording and store."""
    authority = new_authority(tmp_path, "authority")
    certificate = authority.issue("broker", subject_alternative_name="IP:127.0.0.1")
    client = authority.issue("kapvik")
    key = client.key.read_text().splitlines()[1]
    (tmp_path / "password").write_text(SECRET)
    passwords = tmp_path / "passwords"
    if shutil.which("mosquitto_passwd") is None:
        pytest.skip("no mosquitto_passwd here: apt-get install mosquitto")
    write = ["mosquitto_passwd", "-c", "-b", passwords, "kapvik", SECRET]
    await asyncio.to_thread(subprocess.run, write, check=True, capture_output=True)
    await asyncio.to_thread(broker.stop)
    tls = f"cafile {authority.ca.path}\ncertfile {certificate.path}\nkeyfile {certificate.key}\n"
    broker.settings = f"allow_anonymous false\npassword_file {passwords}\nlog_type all\n{tls}require_certificate true\n"
    await asyncio.to_thread(broker.start)
    said = []
    for username in ("kapvik", "nobody"):
        configuration = tmp_path / "rover.toml"
        configuration.write_text(
            f'{ROVER}port = {broker.port}\nusername = "{username}"\npassword_file = "password"\ntls = true\n'
            f'ca_file = "{authority.ca.path}"\ncert_file = "{client.path}"\nkey_file = "{client.key}"\n'
        )
        async with daemon(configuration):
            answer = "u'kapvik'" if username == "kapvik" else "not authorised"
            async with asyncio.timeout(30):
                while answer not in broker.log:  # noqa: ASYNC110  # a file has no event
                    await asyncio.sleep(0.1)
            for options in ([], ["--json"]):
                done = await asyncio.to_thread(
                    CliRunner().invoke, app, ["check", "--config", str(configuration), *options]
                )
                said.append(done.output)
        said.append((tmp_path / "daemon.log").read_text())
    kept = [path.read_bytes() for folder in ("recordings", "spool") for path in (tmp_path / folder).rglob("*.*")]
    assert kept
    assert any("connected to the MQTT broker" in text for text in said)
    assert any("user name or password refused" in text for text in said)
    for text in (*said, *(content.decode(errors="replace") for content in kept)):
        assert SECRET not in text
        assert key not in text


def test_no_option_takes_a_secret() -> None:
    """An argument is shown to every user of the computer by `ps`: a secret is read from a file, or asked for."""
    pending = [get_command(app)]
    names: list[str] = []
    while pending:
        command = pending.pop()
        pending += getattr(command, "commands", {}).values()
        names += [option for parameter in command.params for option in parameter.opts]
    assert "--config" in names
    assert not [name for name in names if re.search("pass|secret|token|key", name)]
