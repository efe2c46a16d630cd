"""Stored messages arrive in order, late ones marked, whatever happens to the broker."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from broker import Mosquitto, unused_port
from estimates import estimate
from subscriber import Subscriber, assert_complete, listening, until

from regolithd.daemon.config.configuration import Configuration, Mqtt
from regolithd.daemon.messages.bus import EventMessage, NodeMessage
from regolithd.daemon.publish.backoff import LONGEST_S, Backoff
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.stores import Stores
from regolithd.daemon.wiring import open_stores

QUICK = {"first": 0.05, "longest": 0.2}


def configuration(folder: Path, port: int, **mqtt: Any) -> Configuration:
    """Return a configuration for a broker on this computer."""
    settings: dict[str, Any] = {"host": "127.0.0.1", "port": port, "keepalive_s": 2} | mqtt
    return Configuration(mqtt=Mqtt(spool_directory=folder, **settings))


@asynccontextmanager
async def running(publisher: Publisher) -> AsyncIterator[asyncio.Task[None]]:
    """Run a publisher, and stop it by cancellation as the daemon does."""
    task = asyncio.create_task(publisher.run())
    try:
        yield task
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


def new_publisher(folder: Path, port: int, **mqtt: Any) -> Publisher:
    """Return a publisher that reconnects after a short delay."""
    settings = configuration(folder, port, **mqtt)
    return Publisher(settings, Stores.open(folder, 10_000_000), backoff=Backoff(**QUICK))


async def test_every_snapshot_and_every_wheel_arrives_live(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """All arrive in order, not marked late, and the store is empty afterwards."""
    publisher = new_publisher(tmp_path, mosquitto.port)
    async with listening(Subscriber(mosquitto.port)) as subscriber, running(publisher):
        await until(lambda: publisher.connected)
        for sequence in range(50):
            publisher.estimate(estimate(sequence))
            await asyncio.sleep(0.01)
        await until(lambda: len(subscriber.of("snapshot")) == 50)
        await until(lambda: subscriber.of("wheel/6") and subscriber.of("wheel/6")[-1]["sequence"] == 49)
        await until(lambda: publisher.report.queued == 0)
    assert subscriber.sequences() == list(range(50))
    assert not any(message["late"] for _, message, _ in subscriber.messages)
    assert publisher.report.repeated == 0
    assert not any(retained for _, _, retained in subscriber.messages)


async def test_birth_and_clean_death_pair_up(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """`offline` is published by the daemon, retained, before it disconnects."""
    publisher = new_publisher(tmp_path, mosquitto.port)
    async with listening(Subscriber(mosquitto.port)) as subscriber:
        async with running(publisher):
            await until(lambda: publisher.connected)
        await until(lambda: len(subscriber.of("state")) == 2)
    birth, death = subscriber.of("state")
    assert (birth["state"], death["state"], death["reason"]) == ("online", "offline", "stopped")
    assert (birth["session"], birth["sequence"]) == (death["session"], death["sequence"])
    async with listening(Subscriber(mosquitto.port, name="latecomer")) as latecomer:
        await until(lambda: latecomer.of("state"))
    assert latecomer.messages == [("state", death, True)]


async def test_while_the_broker_is_away_nothing_is_lost_and_late_ones_are_marked(
    mosquitto: Mosquitto, tmp_path: Path
) -> None:
    """Acquisition continues, and afterwards every snapshot has arrived in order, repeated ones marked late."""
    keep_sessions(mosquitto)
    publisher = new_publisher(tmp_path, mosquitto.port)
    async with listening(Subscriber(mosquitto.port)) as subscriber:
        await through_an_outage(publisher, subscriber, mosquitto)
    assert_complete(subscriber, 150)
    late = {message["sequence"] for message in subscriber.of("snapshot") if message["late"]}
    assert set(range(31, 110)) <= late
    assert not late & set(range(25))
    states = [(message["state"], message["reason"]) for message in subscriber.of("state")]
    assert states[0] == ("online", "connected")
    assert states[-2:] == [("online", "connected"), ("offline", "stopped")]


def keep_sessions(mosquitto: Mosquitto) -> None:
    """Let the broker keep its subscribers' sessions through a restart, as the rover's does (systemd/mosquitto)."""
    mosquitto.stop()
    mosquitto.settings += f"persistence true\npersistence_location {mosquitto.folder}/\n"
    mosquitto.start()


async def through_an_outage(publisher: Publisher, subscriber: Subscriber, mosquitto: Mosquitto) -> None:
    """Publish 150 snapshots, from the 30th to the 110th without a broker, and wait for all to arrive."""
    async with running(publisher):
        await until(lambda: publisher.connected)
        for sequence in range(150):
            if sequence == 30:
                await asyncio.to_thread(mosquitto.stop)
            if sequence == 110:
                await asyncio.to_thread(mosquitto.start)
                await until(lambda: publisher.connected and subscriber.ready.is_set())
            publisher.estimate(estimate(sequence))
            await asyncio.sleep(0.01)
        await until(lambda: publisher.report.queued == 0)
        await until(lambda: 149 in subscriber.sequences())
    await until(lambda: subscriber.of("state")[-1]["state"] == "offline")


async def test_a_frozen_broker_is_noticed_and_nothing_is_lost(
    mosquitto: Mosquitto, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stopped process keeps its connections open, so only the missing acknowledgements show it."""
    monkeypatch.setattr("regolithd.daemon.publish.connection.ACKNOWLEDGE_TIMEOUT_S", 0.5)
    publisher = new_publisher(tmp_path, mosquitto.port)
    async with listening(Subscriber(mosquitto.port)) as subscriber, running(publisher):
        await until(lambda: publisher.connected)
        for sequence in range(20):
            publisher.estimate(estimate(sequence))
        await until(lambda: publisher.report.queued == 0)
        mosquitto.freeze()
        for sequence in range(20, 220):
            publisher.estimate(estimate(sequence))
            await asyncio.sleep(0.005)
        await until(lambda: not publisher.connected)
        assert publisher.report.queued == 200
        await until(lambda: "no answer" in publisher.problem)
        mosquitto.thaw()
        await until(lambda: publisher.connected)
        await until(lambda: publisher.report.queued == 0)
        await until(lambda: 219 in subscriber.sequences())
        await until(lambda: subscriber.of("state")[-1]["state"] == "online")
    assert_complete(subscriber, 220)


async def test_an_estimate_is_taken_at_once_whatever_the_broker_does(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """More estimates than the window and the socket take are accepted without a turn of the event loop."""
    publisher = new_publisher(tmp_path, mosquitto.port)
    async with running(publisher):
        await until(lambda: publisher.connected)
        mosquitto.freeze()
        for sequence in range(500):
            publisher.estimate(estimate(sequence))
        assert publisher.report.queued == 500
        mosquitto.thaw()
        await until(lambda: publisher.report.queued == 0)


async def test_the_next_start_delivers_what_the_last_one_could_not(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """They are marked late, and keep the session that stored them."""
    first = new_publisher(tmp_path / "spool", unused_port())
    async with running(first):
        for sequence in range(10):
            first.estimate(estimate(sequence))
        first.publish("event", EventMessage, kind="node-lost", node_id=3, text="node 3 is silent")
    first._stores.close()
    second = new_publisher(tmp_path / "spool", mosquitto.port)
    async with listening(Subscriber(mosquitto.port)) as subscriber, running(second):
        await until(lambda: subscriber.of("event"))
    assert subscriber.sequences() == list(range(10))
    assert {(message["late"], message["session"]) for message in subscriber.of("snapshot")} == {(True, first.session)}
    assert subscriber.of("event")[0]["text"] == "node 3 is silent"


def node_fields(phase: str, text: str) -> dict[str, Any]:
    """Return the fields of a node's message."""
    return {
        "node_id": 3,
        "kind": "motor",
        "wheel": 3,
        "required": True,
        "phase": phase,
        "nmt_state": None,
        "drive_state": None,
        "heard": None,
        "identity": None,
        "reason": None,
        "text": text,
        "boots": 1,
        "emergencies": 0,
    }


async def test_the_retained_state_of_a_node_is_its_newest_also_after_an_outage(
    mosquitto: Mosquitto, tmp_path: Path
) -> None:
    """A broker that lost its retained messages gets them again, and an old one never replaces a new one."""
    publisher = new_publisher(tmp_path, mosquitto.port)
    async with running(publisher):
        await until(lambda: publisher.connected)
        publisher.publish("node/3", NodeMessage, **node_fields("operational", "first"))
        publisher.publish("node/4", NodeMessage, **node_fields("operational", "untouched"))
        await until(lambda: publisher.report.queued == 0)
        await asyncio.to_thread(mosquitto.kill)  # no persistence: it forgets
        await until(lambda: not publisher.connected)
        publisher.publish("node/3", NodeMessage, **node_fields("lost", "second"))
        publisher.publish("node/3", NodeMessage, **node_fields("operational", "third"))
        await asyncio.to_thread(mosquitto.start)
        await until(lambda: publisher.connected and publisher.report.queued == 0)
        async with listening(Subscriber(mosquitto.port)) as latecomer:
            await until(lambda: len(latecomer.messages) >= 3)
    retained = {
        topic: (message["text"], message["late"]) for topic, message, _ in latecomer.messages if "node" in topic
    }
    assert retained == {"node/3": ("third", True), "node/4": ("untouched", True)}


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"host": "broker.invalid"}, "the name cannot be resolved. Correct [mqtt] host"),
        ({}, "connection refused"),
        (
            {"password_file": Path("/nowhere/password"), "username": "me"},
            "/nowhere/password is not there. Write it, or correct [mqtt] password_file",
        ),
    ],
)
async def test_a_broker_that_cannot_be_reached_is_reported_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, settings: dict[str, Any], said: str
) -> None:
    """The reason is logged once, with what to do, while attempts go on."""
    caplog.set_level(logging.INFO, "regolithd.daemon.publish")
    publisher = new_publisher(tmp_path, unused_port(), **settings)
    async with running(publisher):
        await until(lambda: publisher.report.connections >= 4)
        assert said in publisher.problem
    told = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert len(told) == 1
    assert said in told[0]


async def test_a_password_that_is_not_text_is_reported_and_tried_again(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """The daemon goes on, and connects once the file is corrected."""
    password = tmp_path / "password"
    password.write_bytes(b"\xff\xfe\x00")
    publisher = new_publisher(tmp_path / "spool", mosquitto.port, username="me", password_file=password)
    async with running(publisher):
        await until(lambda: publisher.report.connections >= 2)
        assert "is not UTF-8" in publisher.problem
        password.write_text("secret")
        await until(lambda: publisher.connected)


async def test_messages_are_delivered_without_a_store(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """A folder that cannot be written ends nothing; the reason is given for the alarm."""
    (tmp_path / "file").touch()
    settings = configuration(tmp_path / "file" / "spool", mosquitto.port)
    publisher = Publisher(settings, open_stores(settings.mqtt), backoff=Backoff(**QUICK))
    assert "[mqtt] spool_directory" in publisher.store_problem
    async with listening(Subscriber(mosquitto.port)) as subscriber, running(publisher):
        for sequence in range(5):
            publisher.estimate(estimate(sequence))
        await until(lambda: publisher.report.queued == 0)
        await until(lambda: len(subscriber.of("snapshot")) == 5)
    assert publisher.report.unstored == 5


@pytest.mark.parametrize(
    ("username", "text"),
    [("kapvik", "user name or password refused. Correct"), (None, "a client without a user name is refused. Set")],
)
async def test_a_refused_client_is_reported_and_tried_again_until_it_is_corrected(
    username: str | None, text: str, mosquitto: Mosquitto, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The broker's operator may correct it without a restart of the daemon."""
    mosquitto.stop()
    open_to_all, mosquitto.settings = mosquitto.settings, "allow_anonymous false\n"
    mosquitto.start()
    publisher = new_publisher(tmp_path / "spool", mosquitto.port, username=username)
    async with running(publisher):
        await until(lambda: text in publisher.problem)
        await until(lambda: publisher.report.connections >= 3)
        await asyncio.to_thread(mosquitto.stop)
        mosquitto.settings = open_to_all
        await asyncio.to_thread(mosquitto.start)
        await until(lambda: publisher.connected)
    assert sum(text in record.getMessage() for record in caplog.records) == 1


async def test_two_of_the_same_name_are_reported(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """The broker disconnects one for the other, both back off, and the reason names the rover's name."""
    rivals = [new_publisher(tmp_path / name, mosquitto.port) for name in "ab"]
    async with running(rivals[0]), running(rivals[1]):
        await until(lambda: all(rival.report.connections >= 3 for rival in rivals))
        # A moment: `problem` is empty while connected, and "no answer" where the broker was slow to accept.
        await until(lambda: any("another client uses the same [rover] name" in rival.problem for rival in rivals))


async def test_the_daemon_subscribes_to_nothing(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """The broker's log has no subscription of the daemon, so nothing can be commanded over MQTT."""
    mosquitto.stop()
    mosquitto.settings += "log_type all\n"
    mosquitto.start()
    publisher = new_publisher(tmp_path / "spool", mosquitto.port)
    async with listening(Subscriber(mosquitto.port, name="the-only-one")), running(publisher):
        await until(lambda: publisher.connected)
        publisher.estimate(estimate())
        await until(lambda: publisher.report.queued == 0)
    subscriptions = [line for line in mosquitto.log.splitlines() if "SUBSCRIBE" in line and "Received" in line]
    assert subscriptions
    assert all("the-only-one" in line for line in subscriptions)
    assert "regolithd-regolith-kapvik" in mosquitto.log


def test_waiting_doubles_is_bounded_and_differs_from_rover_to_rover() -> None:
    """The delay starts again at the shortest after a success."""
    backoff = Backoff(first=1.0, longest=20.0)
    delays = [backoff.next() for _ in range(8)]
    for delay, whole in zip(delays, (1, 2, 4, 8, 16, 20, 20, 20), strict=True):
        assert whole / 2 <= delay <= whole
    assert delays != [Backoff(first=1.0, longest=20.0).next() for _ in range(8)]
    backoff.reset()
    assert backoff.next() <= 1.0


async def test_wheels_are_published_at_a_limited_rate(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """At 100 Hz one SYNC in five has `wheel/…` messages; every one has a snapshot."""
    rate = {"sync": {"rate_Hz": 100.0}, "mqtt": configuration(tmp_path, mosquitto.port).mqtt}
    publisher = Publisher(Configuration.model_validate(rate), Stores.open(tmp_path, 10_000_000))
    async with listening(Subscriber(mosquitto.port)) as subscriber, running(publisher):
        await until(lambda: publisher.connected)
        for sequence in range(21):
            publisher.estimate(estimate(sequence))
            await until(lambda: publisher.report.queued == 0)
        await until(lambda: bool(subscriber.of("wheel/6")) and subscriber.of("wheel/6")[-1]["sequence"] == 20)
    assert [each["sequence"] for each in subscriber.of("wheel/6")] == [0, 5, 10, 15, 20]
    assert len(subscriber.of("snapshot")) == 21


async def test_a_broker_that_was_away_for_long_is_connected_to_within_seconds(
    mosquitto: Mosquitto, tmp_path: Path
) -> None:
    """After any number of failed attempts the next one comes within `LONGEST_S`."""
    settings = configuration(tmp_path, mosquitto.port)
    mosquitto.stop()
    publisher = Publisher(settings, Stores.open(tmp_path, 10_000_000))
    publisher._backoff.attempts = 1000  # as after an outage of an hour
    async with running(publisher):
        await until(lambda: bool(publisher.problem))
        await asyncio.to_thread(mosquitto.start)
        begun = time.monotonic()
        await until(lambda: publisher.connected)
    assert time.monotonic() - begun < 2 * LONGEST_S  # the pause, and what the broker and a busy computer take


async def test_a_pause_ends_with_its_time() -> None:
    """A pause of no length beats not once; a stop ends any."""
    beats: list[int] = []
    waiting: Any = SimpleNamespace(_stop=asyncio.Event(), _beat=lambda: beats.append(1))
    await Publisher._pause(waiting, 0.0)
    assert beats == []
    waiting._stop.set()
    await Publisher._pause(waiting, 60.0)
    assert beats == []
