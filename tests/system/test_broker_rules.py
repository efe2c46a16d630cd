"""The broker's example configuration, on mosquitto: who may publish, read, and take which client identifier.

The certificates are issued by the commands of docs/how-to/mqtt-tls.md.
"""

from __future__ import annotations

import asyncio
import re
import shutil
import ssl
import subprocess
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import aiomqtt
import pytest
from broker import Mosquitto, mosquitto_program, unused_port
from estimates import estimate
from running import running
from subscriber import until

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.publish.broker_client import BrokerClient, PublishRefusedError
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.stores import Stores

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "systemd/mosquitto"
PAGE = ROOT / "docs/how-to/mqtt-tls.md"
OTHER_ROVER = "\nuser other\ntopic readwrite regolith/other/#\n"
NAMES = ("kapvik", "other", "operator")
WAIT_S = 1.0
"""Time in which a message that is let through arrives."""


@dataclass
class Site:
    """A broker with the example configuration, its password listener and its TLS listener."""

    folder: Path
    broker: Mosquitto
    tls_port: int

    def client(self, name: str, *, tls: bool, identifier: str | None = None) -> BrokerClient:
        """Return a client with the password, or the certificate, of this name."""
        version = aiomqtt.ProtocolVersion.V5
        if not tls:
            return BrokerClient(
                "127.0.0.1",
                self.broker.port,
                username=name,
                password="secret",
                identifier=identifier,
                protocol=version,
                timeout=5,
            )
        context = ssl.create_default_context(cafile=self.folder / "rover-ca.pem")
        context.load_cert_chain(self.folder / f"{name}.pem", self.folder / f"{name}.key")
        return BrokerClient(
            "127.0.0.1", self.tls_port, tls_context=context, identifier=identifier, protocol=version, timeout=5
        )


def issue_certificates(folder: Path) -> None:
    """Run the commands of the page's first section; those of the client once for each name."""
    section = PAGE.read_text().split("## 1. ")[1].split("\n## ")[0]
    commands = re.findall(r"```sh\n(.*?)```", section, flags=re.DOTALL)
    assert len(commands) == 3
    client = commands.pop()
    for command in (*commands, *(client.replace("kapvik", name) for name in NAMES)):
        subprocess.run(["bash", "-e", "-c", command], check=True, cwd=folder, capture_output=True)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """The example files with this test's paths and ports; nothing else is changed."""
    if mosquitto_program() is None or shutil.which("mosquitto_passwd") is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    if shutil.which("openssl") is None:
        pytest.skip("no openssl here: apt-get install openssl")
    folder = tmp_path_factory.mktemp("site")
    issue_certificates(folder)
    rules = folder / "regolith.acl"
    rules.write_text((EXAMPLE / "regolith.acl").read_text() + OTHER_ROVER)
    rules.chmod(0o600)
    passwords = folder / "regolith.passwd"
    for flag, name in zip((("-c",), (), ()), NAMES, strict=True):
        subprocess.run(["mosquitto_passwd", *flag, "-b", passwords, name, "secret"], check=True, capture_output=True)
    port, tls_port = unused_port(), unused_port()
    settings = "".join((EXAMPLE / name).read_text() for name in ("regolith.conf", "regolith-tls.conf"))
    for theirs, ours in (
        ("/etc/mosquitto/ca_certificates/", f"{folder}/"),
        ("/etc/mosquitto/certs/", f"{folder}/"),
        ("/etc/mosquitto/regolith", f"{folder}/regolith"),
        ("/run/regolithd-mqtt/", f"{folder}/"),
        ("listener 1883 localhost", f"listener {port} 127.0.0.1"),
        ("listener 8883", f"listener {tls_port} 127.0.0.1"),
    ):
        assert theirs in settings
        settings = settings.replace(theirs, ours)
    broker = Mosquitto(folder, settings=settings + "log_type all\n")
    broker.port = port
    broker.own_listener = False
    broker.start()
    yield Site(folder, broker, tls_port)
    broker.stop()


@pytest.fixture(params=[False, True], ids=["password", "certificate"])
def tls(request: pytest.FixtureRequest) -> bool:
    """Whether the clients use TLS and certificates."""
    return bool(request.param)


async def received(client: BrokerClient) -> list[str]:
    """Return the payloads that arrive within a second."""
    found: list[str] = []
    with suppress(TimeoutError):
        async with asyncio.timeout(WAIT_S):
            while True:
                message = await anext(client.messages)
                found.append(bytes(message.payload or b"").decode())
    return found


async def test_a_rover_writes_and_reads_its_own_topics_alone(site: Site, tls: bool) -> None:
    """What it publishes on another rover's topic is refused, and what another one publishes does not reach it."""
    async with site.client("kapvik", tls=tls) as kapvik, site.client("other", tls=tls) as other:
        await kapvik.subscribe("regolith/#", qos=1)
        await kapvik.publish_acknowledged("regolith/kapvik/event", b"mine", retain=False)
        await other.publish_acknowledged("regolith/other/event", b"theirs", retain=False)
        with pytest.raises(PublishRefusedError):
            await other.publish_acknowledged("regolith/kapvik/event", b"a lie", retain=False)
        assert await received(kapvik) == ["mine"]


async def test_an_operator_reads_every_rover_and_writes_nothing(site: Site, tls: bool) -> None:
    """Every topic is refused, its own name's included."""
    async with site.client("operator", tls=tls) as operator, site.client("kapvik", tls=tls) as kapvik:
        await operator.subscribe("regolith/#", qos=1)
        await kapvik.publish_acknowledged("regolith/kapvik/event", b"seen", retain=False)
        assert await received(operator) == ["seen"]
    for topic in ("regolith/kapvik/state", "regolith/operator/state", "elsewhere"):
        async with site.client("operator", tls=tls) as operator:
            with pytest.raises(PublishRefusedError):
                await operator.publish_acknowledged(topic, b"a lie", retain=True)


@asynccontextmanager
async def daemon(site: Site, folder: Path, *, tls: bool) -> AsyncIterator[Publisher]:
    """The daemon's publisher as the page configures it, connected."""
    secret = folder / "mqtt-password"
    secret.write_text("secret\n")
    certificate = {"ca_file": "rover-ca.pem", "cert_file": "kapvik.pem", "key_file": "kapvik.key"}
    files = {key: site.folder / name for key, name in certificate.items()}
    account = {"tls": True, **files} if tls else {"username": "kapvik", "password_file": secret}
    port = site.tls_port if tls else site.broker.port
    mqtt = {"host": "127.0.0.1", "port": port, "spool_directory": folder / "spool", **account}
    publisher = Publisher(Configuration.model_validate({"mqtt": mqtt}), Stores.open(folder / "spool", 1_000_000))
    async with running(publisher):
        await until(lambda: publisher.connected)
        yield publisher


@pytest.mark.parametrize("taken", ["regolithd-regolith-kapvik", "kapvik"])
async def test_nobody_takes_the_client_identifier_of_the_daemon(
    taken: str, site: Site, tls: bool, tmp_path: Path
) -> None:
    """Clients with its identifier, by password and by certificate, leave the daemon connected, and it delivers."""
    async with daemon(site, tmp_path, tls=tls) as publisher:
        for theirs in (False, True):
            for name in ("operator", "other"):
                async with site.client(name, tls=theirs, identifier=taken):
                    await asyncio.sleep(0.2)
        publisher.estimate(estimate())
        await until(lambda: publisher.report.acknowledged == 1)
        assert publisher.report.connections == 1
    assert "as kapvik (p5, c1, k10, u'kapvik')" in site.broker.log


async def test_without_a_name_or_a_certificate_nobody_connects(site: Site) -> None:
    """Neither without a password, nor over TLS with a password alone."""
    context = ssl.create_default_context(cafile=site.folder / "rover-ca.pem")
    anonymous = aiomqtt.Client("127.0.0.1", site.broker.port, timeout=1)
    password = aiomqtt.Client(
        "127.0.0.1", site.tls_port, username="kapvik", password="secret", tls_context=context, timeout=1
    )
    for client in (anonymous, password):
        with pytest.raises(aiomqtt.MqttError):
            async with client:
                pass


def test_the_broker_sends_at_once() -> None:
    """The example sets TCP_NODELAY; `TCP_OPTIONS` are the daemon's side."""
    lines = (EXAMPLE / "regolith.conf").read_text().splitlines()
    assert "set_tcp_nodelay true" in lines
