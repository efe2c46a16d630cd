"""What the daemon measured arrives, whatever happens to the broker, to the network, or to the daemon itself."""

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
from listener import Subscriber, listening, until

from regolithd.daemon.publish.segment import Segment

ROOT = Path(__file__).parents[2]
RATE_Hz = 20
KILLS = 20
OUTAGE_S = 30


class Daemon:
    """The daemon's process."""

    def __init__(self, folder: Path, port: int) -> None:
        self.folder = folder
        self.spool = folder / "spool"
        self.configuration = folder / "rover.toml"
        self.configuration.write_text(
            f"""
[bus]
interface = "virtual"
channel = "lone"
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
        """Start it."""
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        command = [sys.executable, ROOT / "tests" / "bench" / "lone_daemon.py", self.configuration]
        with (self.folder / "daemon.log").open("ab") as log:
            self.process = subprocess.Popen(command, env=environment, stderr=log)

    def kill(self) -> None:
        """Kill it as nothing can be prepared for."""
        assert self.process is not None
        assert self.process.poll() is None, (self.folder / "daemon.log").read_text()
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        """Stop it as its service manager would."""
        assert self.process is not None
        self.process.terminate()
        assert self.process.wait(30) == 0, (self.folder / "daemon.log").read_text()

    def queued(self) -> set[tuple[str, int]]:
        """Return session and sequence of the snapshots on disk that wait, or waited, for the broker."""
        found = set()
        for path in self.spool.glob("*.segment"):
            for record in Segment.found(path).read():
                if record.topic == "snapshot":
                    message = json.loads(record.payload)
                    found.add((message["session"], message["sequence"]))
        return found


@pytest.fixture
def lasting(mosquitto: Mosquitto) -> Mosquitto:
    """A broker that remembers its subscribers through a restart and drops nothing for them, as the rover's does."""
    mosquitto.stop()
    mosquitto.settings += (
        f"persistence true\npersistence_location {mosquitto.folder}/\nmax_queued_messages 10000\n"
        "max_inflight_messages 100\n"
    )
    mosquitto.start()
    return mosquitto


@pytest.fixture
def daemon(lasting: Mosquitto, tmp_path: Path) -> Iterator[Daemon]:
    """A daemon that does not outlive its test."""
    daemon = Daemon(tmp_path, lasting.port)
    yield daemon
    if daemon.process is not None and daemon.process.poll() is None:
        daemon.kill()


def snapshots(subscriber: Subscriber) -> dict[str, list[int]]:
    """Return session → sequence numbers in the order of their first arrival."""
    found: dict[str, list[int]] = defaultdict(list)
    for message in subscriber.of("snapshot"):
        if message["sequence"] not in found[message["session"]]:
            found[message["session"]].append(message["sequence"])
    return found


def assert_told_once_or_marked(subscriber: Subscriber) -> None:
    """Hold that nothing came twice unmarked, but for what the broker itself repeated."""
    times: Counter[tuple[str, str, int]] = Counter()
    for place, (topic, message, _) in enumerate(subscriber.messages):
        if topic in {"snapshot", "event", "emcy"}:
            key = (topic, message["session"], message["sequence"])
            assert not times[key] or message["late"] or place in subscriber.repeated_by_broker, key
            times[key] += 1


@pytest.mark.timeout(180)
async def test_a_broker_that_was_away_for_half_a_minute_has_missed_nothing(lasting: Mosquitto, daemon: Daemon) -> None:
    """Every SYNC of the whole time arrives, in order, those of the outage marked late; live ones are not marked."""
    async with listening(Subscriber(lasting.port)) as subscriber:
        daemon.start()
        await until(lambda: len(subscriber.of("snapshot")) > RATE_Hz)
        before = subscriber.of("snapshot")[-1]["sequence"]
        await asyncio.to_thread(lasting.stop)
        await asyncio.sleep(OUTAGE_S)
        await asyncio.to_thread(lasting.start)
        await until(lambda: subscriber.of("snapshot")[-1]["sequence"] > before + RATE_Hz * OUTAGE_S)
        await until(lambda: not subscriber.of("snapshot")[-1]["late"])
        after = subscriber.of("snapshot")[-1]["sequence"]
        await asyncio.to_thread(daemon.stop)
        await until(lambda: subscriber.of("state")[-1]["reason"] == "stopped")
    (sequences,) = snapshots(subscriber).values()
    assert sequences == list(range(sequences[-1] + 1))
    assert sequences[-1] >= after
    assert_told_once_or_marked(subscriber)
    late = {message["sequence"] for message in subscriber.of("snapshot") if message["late"]}
    assert len(late) >= RATE_Hz * (OUTAGE_S - 2)
    times = {message["sequence"]: message["time"] for message in subscriber.of("snapshot")}
    assert [times[sequence] for sequence in sequences] == sorted(times.values())


@pytest.mark.timeout(300)
async def test_twenty_kills_at_random_moments_lose_nothing_that_was_queued(lasting: Mosquitto, daemon: Daemon) -> None:
    """Some fall into an outage, or into a broker that hangs; whatever was in the store arrives after the next start."""
    chance = random.Random(20130611)
    queued: set[tuple[str, int]] = set()
    async with listening(Subscriber(lasting.port)) as subscriber:
        for _ in range(KILLS):
            count = len(snapshots(subscriber))
            daemon.start()
            await until(lambda count=count: len(snapshots(subscriber)) > count)
            if chance.random() < 0.3:
                lasting.freeze()
            await asyncio.sleep(chance.uniform(0.0, 1.0))
            daemon.kill()
            queued |= daemon.queued()
            lasting.thaw()
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
    assert_told_once_or_marked(subscriber)
    assert_births_and_deaths_pair_up(subscriber)


def assert_births_and_deaths_pair_up(subscriber: Subscriber) -> None:
    """Every connection has been born once and has died: by the will where the daemon was killed."""
    states = [(m["session"], m["sequence"], m["state"], m["reason"]) for m in subscriber.of("state")]
    born = {(session, sequence) for session, sequence, state, _ in states if state == "online"}
    died = {(session, sequence): reason for session, sequence, state, reason in states if state == "offline"}
    assert born <= died.keys()
    reasons = Counter(died[birth] for birth in born)
    assert reasons == {"connection-lost": KILLS, "stopped": 1}
