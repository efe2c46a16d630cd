"""Every queued message arrives after an outage of the broker and after a SIGKILL of the daemon."""

import asyncio
import json
import os
import random
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from broker import Mosquitto
from subscriber import Subscriber, listening, until

from regolithd.daemon.publish.segment import Segment

ROOT = Path(__file__).parents[2]
RATE_Hz = 20
KILLS = 20
OUTAGE_S = 30


class Daemon:
    """A daemon without nodes, as a process."""

    def __init__(self, folder: Path, port: int) -> None:
        self.folder = folder
        self.spool = folder / "spool"
        self.configuration = folder / "rover.toml"
        self.configuration.write_text(
            f"""
[bus]
interface = "virtual"
channel = "without-nodes"
[sync]
rate_Hz = {RATE_Hz}
[recording]
enabled = false
[mqtt]
host = "127.0.0.1"
port = {port}
spool_directory = "{self.spool}"
[control]
socket = "{folder}/control.sock"
group = "{os.getgid()}"
"""
        )
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the process."""
        command = [sys.executable, ROOT / "tests" / "bench" / "daemon_without_nodes.py", self.configuration]
        with (self.folder / "daemon.log").open("ab") as log:
            self.process = subprocess.Popen(command, stderr=log)

    def kill(self) -> None:
        """Kill the process (SIGKILL)."""
        assert self.process is not None
        assert self.process.poll() is None, (self.folder / "daemon.log").read_text()
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        """Stop the process (SIGTERM); it must exit with 0."""
        assert self.process is not None
        self.process.terminate()
        assert self.process.wait(30) == 0, (self.folder / "daemon.log").read_text()

    def queued(self) -> set[tuple[str, int]]:
        """Return session and sequence of the snapshots in the spool."""
        found = set()
        for path in self.spool.glob("*.segment"):
            for record in Segment.found(path).read():
                if record.topic == "snapshot":
                    message = json.loads(record.payload)
                    found.add((message["session"], message["sequence"]))
        return found


@pytest.fixture
def persistent(mosquitto: Mosquitto) -> Mosquitto:
    """A broker that keeps sessions through a restart and drops no queued message, as the rover's."""
    mosquitto.stop()
    mosquitto.settings += (
        f"persistence true\npersistence_location {mosquitto.folder}/\nmax_queued_messages 10000\n"
        "max_inflight_messages 100\n"
    )
    mosquitto.start()
    return mosquitto


@pytest.fixture
def daemon(persistent: Mosquitto, tmp_path: Path) -> Iterator[Daemon]:
    """A daemon that is killed after the test."""
    daemon = Daemon(tmp_path, persistent.port)
    yield daemon
    if daemon.process is not None and daemon.process.poll() is None:
        daemon.kill()


def snapshots(subscriber: Subscriber) -> dict[str, list[int]]:
    """Return the sequence numbers of each session in the order of their first arrival."""
    found: dict[str, list[int]] = defaultdict(list)
    for message in subscriber.of("snapshot"):
        if message["sequence"] not in found[message["session"]]:
            found[message["session"]].append(message["sequence"])
    return found


def assert_repetitions_are_late(subscriber: Subscriber) -> None:
    """Assert that a repeated message is marked late, unless the broker repeated it (DUP)."""
    times: Counter[tuple[str, str, int]] = Counter()
    for place, (topic, message, _) in enumerate(subscriber.messages):
        if topic in {"snapshot", "event", "emcy"}:
            key = (topic, message["session"], message["sequence"])
            assert not times[key] or message["late"] or place in subscriber.repeated_by_broker, key
            times[key] += 1


@pytest.mark.timeout(180)
async def test_nothing_is_lost_in_an_outage_of_half_a_minute(persistent: Mosquitto, daemon: Daemon) -> None:
    """Every snapshot arrives in order, and those of the outage are marked late."""
    async with listening(Subscriber(persistent.port)) as subscriber:
        daemon.start()
        await until(lambda: len(subscriber.of("snapshot")) > RATE_Hz)
        before = subscriber.of("snapshot")[-1]["sequence"]
        await asyncio.to_thread(persistent.stop)
        await asyncio.sleep(OUTAGE_S)
        await asyncio.to_thread(persistent.start)
        await until(lambda: subscriber.of("snapshot")[-1]["sequence"] > before + RATE_Hz * OUTAGE_S)
        await until(lambda: not subscriber.of("snapshot")[-1]["late"])
        after = subscriber.of("snapshot")[-1]["sequence"]
        await asyncio.to_thread(daemon.stop)
        await until(lambda: subscriber.of("state")[-1]["reason"] == "stopped")
    (sequences,) = snapshots(subscriber).values()
    assert sequences == list(range(sequences[-1] + 1))
    assert sequences[-1] >= after
    assert_repetitions_are_late(subscriber)
    late = {message["sequence"] for message in subscriber.of("snapshot") if message["late"]}
    assert len(late) >= RATE_Hz * (OUTAGE_S - 2)
    times = {message["sequence"]: message["time"] for message in subscriber.of("snapshot")}
    assert [times[sequence] for sequence in sequences] == sorted(times.values())


@pytest.mark.timeout(300)
async def test_twenty_kills_at_random_moments_lose_nothing_that_was_queued(
    persistent: Mosquitto, daemon: Daemon
) -> None:
    """Every snapshot in the spool at a kill arrives after a restart, also if the broker hung meanwhile."""
    chance = random.Random(20130611)
    queued: set[tuple[str, int]] = set()
    async with listening(Subscriber(persistent.port)) as subscriber:
        for _ in range(KILLS):
            count = len(snapshots(subscriber))
            daemon.start()
            await until(lambda count=count: len(snapshots(subscriber)) > count)
            if chance.random() < 0.3:
                persistent.freeze()
            await asyncio.sleep(chance.uniform(0.0, 1.0))
            daemon.kill()
            queued |= daemon.queued()
            persistent.thaw()
        daemon.start()
        await until(lambda: len(snapshots(subscriber)) > KILLS)
        await asyncio.to_thread(daemon.stop)
        await until(lambda: subscriber.of("state")[-1]["reason"] == "stopped")
    arrived = snapshots(subscriber)
    assert len(arrived) == KILLS + 1
    missing = queued - {(session, sequence) for session, sequences in arrived.items() for sequence in sequences}
    assert not missing
    assert len(queued) > KILLS
    for sequences in arrived.values():
        assert sequences == list(range(len(sequences)))
    assert_repetitions_are_late(subscriber)
    assert_each_birth_has_a_death(subscriber)


def assert_each_birth_has_a_death(subscriber: Subscriber) -> None:
    """Assert that each `online` is followed by `offline`: by the will where the daemon was killed."""
    states = [(m["session"], m["sequence"], m["state"], m["reason"]) for m in subscriber.of("state")]
    born = {(session, sequence) for session, sequence, state, _ in states if state == "online"}
    died = {(session, sequence): reason for session, sequence, state, reason in states if state == "offline"}
    assert born <= died.keys()
    reasons = Counter(died[birth] for birth in born)
    assert reasons == {"connection-lost": KILLS, "stopped": 1}
