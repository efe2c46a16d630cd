"""A broker on the same computer is reached by its Unix socket."""

from __future__ import annotations

import asyncio
import errno
import socket
from contextlib import suppress
from typing import TYPE_CHECKING

import pytest
from broker import Mosquitto
from estimates import estimate
from subscriber import Subscriber, listening, until

from regolithd.daemon.check.broker import check_broker
from regolithd.daemon.check.finding import Verdict
from regolithd.daemon.config.broker import BrokerSettings
from regolithd.daemon.config.configuration import Configuration, Mqtt
from regolithd.daemon.publish import connection_errors
from regolithd.daemon.publish.backoff import Backoff
from regolithd.daemon.publish.connection_errors import explain, reason_of
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.stores import Stores
from regolithd.daemon.publish.transport import TCP_OPTIONS, transport_of

if TYPE_CHECKING:
    from pathlib import Path


async def test_messages_are_delivered_by_a_unix_socket_also_after_the_broker_was_killed(tmp_path: Path) -> None:
    """A killed broker leaves its socket behind: it is waited for, and the next one is connected to."""
    path = tmp_path / "mosquitto.sock"
    broker = Mosquitto(tmp_path, settings=f"listener 0 {path}\nallow_anonymous true\n")
    broker.start()
    configuration = Configuration(mqtt=Mqtt(socket=path, spool_directory=tmp_path / "spool"))
    publisher = Publisher(configuration, Stores.open(tmp_path / "spool", 10_000_000), backoff=Backoff(0.05, 0.1))
    running = asyncio.create_task(publisher.run())
    async with listening(Subscriber(broker.port)) as subscriber:
        publisher.estimate(estimate(0))
        await until(lambda: len(subscriber.of("snapshot")) == 1)
        (finding,) = await check_broker(configuration)
        assert (finding.verdict, "Unix socket" in finding.text) == (Verdict.GOOD, True)
        await asyncio.to_thread(broker.kill)
        await until(lambda: "connection refused. Start the broker, or correct [mqtt] socket" in publisher.problem)
    publisher.estimate(estimate(1))
    await asyncio.to_thread(broker.start)
    await until(lambda: publisher.connected and publisher.report.queued == 0)
    running.cancel()
    with suppress(asyncio.CancelledError):
        await running
    broker.stop()


async def test_a_socket_that_takes_no_connection_is_no_answer_at_once(tmp_path: Path) -> None:
    """A broker that hangs must not block the thread that connects."""
    path = tmp_path / "full.sock"
    settings = BrokerSettings(socket=path)
    with socket.socket(socket.AF_UNIX) as hung, socket.socket(socket.AF_UNIX) as waiting:
        hung.bind(str(path))
        hung.listen(0)
        waiting.connect(str(path))
        with pytest.raises(BlockingIOError) as caught:
            transport_of(settings).check_accepts()
    assert "no answer" in await explain(caught.value, settings)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (FileNotFoundError(errno.ENOENT, "No such file"), "there is no such socket. Start the broker"),
        (PermissionError(errno.EACCES, "Permission denied"), "this user may not open it"),
        (TimeoutError(), "no answer"),
        (OSError(errno.EIO, "strange"), "strange"),
        (FileNotFoundError(errno.ENOENT, "No such file", "/etc/password"), "/etc/password"),
    ],
)
def test_each_failure_of_a_unix_socket_has_its_text(error: OSError, said: str, tmp_path: Path) -> None:
    """It names the socket, or the file of the credentials that is missing."""
    text = reason_of(error, BrokerSettings(socket=tmp_path / "mosquitto.sock"))
    assert text.startswith(f"MQTT broker {tmp_path}/mosquitto.sock: ")
    assert said in text


@pytest.mark.parametrize("error", [OSError(errno.EAFNOSUPPORT, "not supported"), socket.gaierror(-3, "temporary")])
def test_a_service_without_internet_sockets_says_so(error: OSError, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the name service nor the broker is to blame."""
    assert "no Internet sockets" not in reason_of(error, BrokerSettings())
    monkeypatch.setattr(connection_errors, "_may_use_ip", lambda: False)
    assert "broker-over-ip.conf" in reason_of(error, BrokerSettings())
    assert "connection refused" in reason_of(ConnectionRefusedError(), BrokerSettings())


def test_host_and_port_are_used_without_a_socket(tmp_path: Path) -> None:
    """Only TCP has the option of TCP."""
    assert transport_of(BrokerSettings(host="rover", port=8883)).socket_options == TCP_OPTIONS
    unix = transport_of(BrokerSettings(host="rover", socket=tmp_path))
    assert (unix.host, unix.kind, unix.socket_options) == (str(tmp_path), "unix", ())
