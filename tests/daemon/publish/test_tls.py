"""MQTT over TLS with client certificates, against mosquitto: what connects, and what each failure is called."""

from __future__ import annotations

import gc
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pytest
from broker import Mosquitto, mosquitto_program
from certificates import Authority, Certificate, new_authority
from estimates import estimate
from running import running
from subscriber import until

from regolithd.daemon.check.broker import check_broker
from regolithd.daemon.config.configuration import Configuration, Mqtt
from regolithd.daemon.ground.settings import Broker
from regolithd.daemon.ground.subscription import Subscription
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.stores import Stores

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

HERE = "DNS:localhost,IP:127.0.0.1"
# paho leaves the socket of a failed handshake to the garbage collector.
pytestmark = pytest.mark.filterwarnings(
    "ignore:Exception ignored in. <ssl.SSLSocket:pytest.PytestUnraisableExceptionWarning",
    "ignore:Exception ignored in. <socket:pytest.PytestUnraisableExceptionWarning",
)


@dataclass(frozen=True)
class Issued:
    """The authority of rovers and broker, another one, and certificates of both."""

    ours: Authority
    foreign: Authority
    broker: Certificate
    kapvik: Certificate


@pytest.fixture(scope="module")
def issued(tmp_path_factory: pytest.TempPathFactory) -> Issued:
    """Certificates that are valid, for 127.0.0.1 and for the rover kapvik."""
    folder = tmp_path_factory.mktemp("certificates")
    ours, foreign = (new_authority(folder, name) for name in ("ours", "foreign"))
    return Issued(ours, foreign, ours.issue("broker", subject_alternative_name=HERE), ours.issue("kapvik"))


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[str], Mosquitto]]:
    """Start a broker with these settings."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    started: list[Mosquitto] = []

    def start(settings: str) -> Mosquitto:
        broker = Mosquitto(tmp_path, settings=settings)
        started.append(broker)
        broker.start()
        return broker

    yield start
    for broker in started:
        broker.stop()
    gc.collect()  # here, where the warning is expected


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A broker on this computer answers within half a second, or not at all."""
    monkeypatch.setattr("regolithd.daemon.publish.connection.ACKNOWLEDGE_TIMEOUT_S", 0.5)
    monkeypatch.setattr("regolithd.daemon.check.broker.TIMEOUT_S", 0.5)
    monkeypatch.setattr("regolithd.daemon.ground.subscription.TIMEOUT_S", 0.5)


def secured(authority: Authority, certificate: Certificate) -> str:
    """Return the settings of a broker with this certificate that requires one of its clients."""
    return (
        f"allow_anonymous true\ncafile {authority.ca.path}\ncertfile {certificate.path}\nkeyfile {certificate.key}\n"
        "require_certificate true\nuse_identity_as_username true\n"
    )


def mqtt(broker: Mosquitto, issued: Issued, client: Certificate | None) -> dict[str, Any]:
    """Return the settings of a client with this certificate."""
    settings = {"host": "127.0.0.1", "port": broker.port, "tls": True, "ca_file": issued.ours.ca.path}
    return settings | ({"cert_file": client.path, "key_file": client.key} if client else {})


async def problem(folder: Path, settings: dict[str, Any]) -> str:
    """Return what the daemon says of a connection that fails."""
    configuration = Configuration(mqtt=Mqtt(spool_directory=folder / "spool", **settings))
    publisher = Publisher(configuration, Stores.open(folder / "spool", 1_000_000))
    async with running(publisher):
        await until(lambda: publisher.problem)
        return publisher.problem


async def test_a_rover_with_a_certificate_delivers(
    start: Callable[[str], Mosquitto], issued: Issued, tmp_path: Path
) -> None:
    """The broker takes the CN of the certificate for the user name."""
    broker = start(secured(issued.ours, issued.broker))
    configuration = Configuration(
        mqtt=Mqtt(spool_directory=tmp_path / "spool", **mqtt(broker, issued, issued.kapvik)),
    )
    publisher = Publisher(configuration, Stores.open(tmp_path / "spool", 1_000_000))
    async with running(publisher):
        publisher.estimate(estimate())
        await until(lambda: publisher.report.acknowledged == 1)
    assert "u'kapvik'" in broker.log
    (finding,) = await check_broker(configuration)
    assert f"accepts the holder of {issued.kapvik.path}, TLS" in finding.text


@pytest.mark.parametrize(
    ("client", "text", "remedy"),
    [
        (None, "requires a client certificate", "Set [mqtt] cert_file and key_file"),
        ("expired", "the client certificate has expired", "Renew [mqtt] cert_file"),
        ("foreign", "does not know the authority of the client certificate", "Correct [mqtt] cert_file"),
    ],
)
async def test_what_is_wrong_with_the_client_certificate_is_said(
    client: str | None, text: str, remedy: str, start: Callable[[str], Mosquitto], issued: Issued, tmp_path: Path
) -> None:
    """TLS 1.3 tells it after the handshake; the message names it, and the key to correct."""
    broker = start(secured(issued.ours, issued.broker))
    certificates = {
        "expired": lambda: issued.ours.issue("kapvik", expired=True),
        "foreign": lambda: issued.foreign.issue("kapvik"),
    }
    certificate = certificates[client]() if client else None
    found = await problem(tmp_path, mqtt(broker, issued, certificate))
    assert found.startswith(f"MQTT broker 127.0.0.1:{broker.port}: ")
    assert text in found
    assert remedy in found


@pytest.mark.parametrize(
    ("kind", "text", "remedy"),
    [
        ("expired", "the broker's certificate has expired", "Renew it"),
        ("foreign", "the authority of the broker's certificate is not known", "[mqtt] ca_file"),
        ("wrong-name", "the broker's certificate is for another address", "Correct [mqtt] host"),
    ],
)
async def test_what_is_wrong_with_the_certificate_of_the_broker_is_said(
    kind: str, text: str, remedy: str, start: Callable[[str], Mosquitto], issued: Issued, tmp_path: Path
) -> None:
    """Each in its own words, with what to correct."""
    certificate = {
        "expired": lambda: issued.ours.issue("broker", subject_alternative_name=HERE, expired=True),
        "foreign": lambda: issued.foreign.issue("broker", subject_alternative_name=HERE),
        "wrong-name": lambda: issued.ours.issue("broker", subject_alternative_name="DNS:elsewhere"),
    }[kind]()
    broker = start(secured(issued.ours, certificate))
    found = await problem(tmp_path, mqtt(broker, issued, issued.kapvik))
    assert text in found
    assert remedy in found


async def test_without_ca_file_the_authorities_of_the_system_count(
    start: Callable[[str], Mosquitto], issued: Issued, tmp_path: Path
) -> None:
    """None of them has signed the broker's certificate."""
    settings = mqtt(start(secured(issued.ours, issued.broker)), issued, issued.kapvik) | {"ca_file": None}
    assert "Name it in [mqtt] ca_file" in await problem(tmp_path, settings)


async def test_a_broker_of_another_host_name_is_told_from_one_of_another_address(
    start: Callable[[str], Mosquitto], issued: Issued, tmp_path: Path
) -> None:
    """The name that was looked for is `[mqtt] host`."""
    certificate = issued.ours.issue("broker", subject_alternative_name="DNS:elsewhere")
    settings = mqtt(start(secured(issued.ours, certificate)), issued, issued.kapvik) | {"host": "localhost"}
    assert "for another host name" in await problem(tmp_path, settings)


async def test_a_broker_with_tls_is_told_from_one_that_does_not_answer(
    start: Callable[[str], Mosquitto], issued: Issued, tmp_path: Path
) -> None:
    """A client without TLS, on the port with TLS."""
    broker = start(secured(issued.ours, issued.broker))
    found = await problem(tmp_path, {"host": "127.0.0.1", "port": broker.port})
    assert "the broker expects TLS on this port. Set [mqtt] tls = true" in found


async def test_a_broker_without_tls_gets_no_password(
    start: Callable[[str], Mosquitto], issued: Issued, tmp_path: Path
) -> None:
    """A client with TLS, on the port without TLS."""
    broker = start("allow_anonymous true\n")
    found = await problem(tmp_path, mqtt(broker, issued, issued.kapvik))
    assert "the broker speaks no TLS on this port" in found
    assert "New client connected" not in broker.log


async def test_a_rover_with_the_certificate_of_another_loses_nothing(
    start: Callable[[str], Mosquitto], issued: Issued, tmp_path: Path
) -> None:
    """The broker accepts the connection, and no message; all stay in the store, and the message names the topic."""
    rules = tmp_path / "rules"
    rules.write_text("user kapvik\ntopic readwrite regolith/kapvik/#\n")
    rules.chmod(0o600)
    broker = start(secured(issued.ours, issued.broker) + f"acl_file {rules}\n")
    settings = mqtt(broker, issued, issued.ours.issue("other"))
    configuration = Configuration(mqtt=Mqtt(spool_directory=tmp_path / "spool", **settings))
    publisher = Publisher(configuration, Stores.open(tmp_path / "spool", 1_000_000))
    publisher.estimate(estimate())
    async with running(publisher):
        await until(lambda: "may not publish on regolith/kapvik/state" in publisher.problem)
        assert "access rules" in publisher.problem
        assert publisher.report.queued == 1


async def test_check_and_ground_say_the_same(
    start: Callable[[str], Mosquitto], issued: Issued, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A missing client certificate, in `regolithd check` and on the ground; the library logs nothing beside it."""
    settings = mqtt(start(secured(issued.ours, issued.broker)), issued, None)
    (finding,) = await check_broker(Configuration(mqtt=Mqtt(spool_directory=tmp_path, **settings)))
    assert finding.verdict == "wrong"
    assert "requires a client certificate" in finding.text
    assert finding.remedy.startswith("Set [mqtt] cert_file")
    assert caplog.messages == []
    subscription = Subscription(Broker(**settings), lambda _: None)
    async with running(subscription):
        await until(lambda: "requires a client certificate" in subscription.problem)


async def test_check_names_the_certificate_that_is_accepted(
    start: Callable[[str], Mosquitto], issued: Issued, tmp_path: Path
) -> None:
    """A broker that requires a client certificate does not accept anyone."""
    settings = mqtt(start(secured(issued.ours, issued.broker)), issued, issued.kapvik)
    (finding,) = await check_broker(Configuration(mqtt=Mqtt(spool_directory=tmp_path, **settings)))
    assert finding.verdict == "good"
    assert f"accepts the holder of {issued.kapvik.path}, TLS" in finding.text


FILES = {
    "absent ca_file": ({"ca_file": "absent.pem"}, "absent.pem is not there. Write it, or correct [mqtt] ca_file"),
    "a folder as cert_file": ({"cert_file": "."}, "is a folder. Name a file in [mqtt] cert_file"),
    "empty ca_file": ({"ca_file": "empty.pem"}, "empty.pem holds no certificate"),
    "not of the same pair": ({"key_file": "other.key"}, "is not the private key of"),
    "no key": ({"key_file": "empty.pem"}, "holds no certificate and key in PEM"),
    "encrypted key": ({"key_file": "encrypted.key"}, "is encrypted. Store [mqtt] key_file without a passphrase"),
}


@pytest.mark.parametrize("case", FILES)
async def test_a_file_that_cannot_be_used_is_named(case: str, issued: Issued, tmp_path: Path) -> None:
    """Before a connection is tried; nobody is asked for a passphrase."""
    changed, text = FILES[case]
    (tmp_path / "empty.pem").write_text("")
    other = issued.ours.issue("other")
    (tmp_path / "other.key").write_bytes(other.key.read_bytes())
    issued.ours.encrypt(issued.kapvik.key, tmp_path / "encrypted.key", "secret")
    valid = {"ca_file": issued.ours.ca.path, "cert_file": issued.kapvik.path, "key_file": issued.kapvik.key}
    settings = {"tls": True} | valid | {key: tmp_path / name for key, name in changed.items()}
    found = await problem(tmp_path, settings)
    assert text in found
    assert "[mqtt]" in found
