"""No message is lost, for any order of storing, sending, acknowledging, disconnecting and being killed."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regolithd.daemon.publish.encode import write
from regolithd.daemon.publish.outbox import LIVE_WITHIN_NS, Outbox, OutgoingMessage, is_retained
from regolithd.daemon.publish.spool import Spool


def message(number: int) -> bytes:
    """Return a payload that holds its number and can be marked late."""
    return write({"schema_version": 2, "late": False, "number": number})


def number_of(letter: OutgoingMessage) -> int:
    """Return the number in a message's payload; its `late` must agree with the payload's."""
    assert letter.payload.startswith(b'{"schema_version":2,"late":' + (b"true" if letter.late else b"false"))
    return int(letter.payload.split(b":")[-1].rstrip(b"}"))


class World:
    """A daemon and a broker; what the broker received is in `arrived`, as (number, late)."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.stored = 0
        self.arrived: list[tuple[int, bool]] = []
        self.flying: list[OutgoingMessage] = []
        self.is_connected = False
        self.boot()

    def boot(self) -> None:
        """Start the daemon's process."""
        self.spool = Spool(self.folder, 10_000_000, segment_bytes=600)
        self.outbox = Outbox(self.spool)

    def store(self, count: int) -> None:
        """Store a message."""
        for _ in range(count):
            self.outbox.store("snapshot", message(self.stored))
            self.stored += 1

    def connect(self, _: int = 0) -> None:
        """Begin a new connection."""
        self.flying.clear()
        self.outbox.connected()
        self.is_connected = True

    def send(self, count: int) -> None:
        """Send some messages, which the broker receives."""
        while self.is_connected and count:
            letter = next(self.outbox.waiting(), None)
            if letter is None:
                return
            self.outbox.sent(letter)
            self.arrived.append((number_of(letter), letter.late))
            self.flying.append(letter)
            count -= 1

    def acknowledge(self, count: int) -> None:
        """Acknowledge some messages, the last first."""
        taken, self.flying = self.flying[:count], self.flying[count:]
        for letter in reversed(taken):
            self.outbox.acknowledged(letter)

    def lose(self, _: int) -> None:
        """Lose the connection with all unacknowledged messages."""
        self.is_connected = False
        self.flying.clear()

    def kill(self, _: int) -> None:
        """Kill the daemon and start it again."""
        self.spool.close()
        self.boot()
        self.lose(0)


STEPS = ("store", "connect", "send", "acknowledge", "lose", "kill")


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(STEPS), st.integers(1, 40)), max_size=40))
def test_everything_arrives_in_order_and_what_comes_twice_is_marked(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[str, int]]
) -> None:
    """Once everything is acknowledged, nothing waits."""
    world = World(tmp_path_factory.mktemp("outbox"))
    for step, count in steps:
        getattr(world, step)(count)
    world.connect()
    world.send(world.stored + 1)
    world.acknowledge(world.stored + 1)
    first = list(dict.fromkeys(number for number, _ in world.arrived))
    assert first == list(range(world.stored))
    seen: set[int] = set()
    for number, late in world.arrived:
        assert late or number not in seen
        seen.add(number)
    assert world.spool.queued == 0
    assert world.spool.counters.dropped == 0
    world.spool.close()


@pytest.fixture
def outbox(tmp_path: Path) -> Outbox:
    """An outbox that is connected."""
    box = Outbox(Spool(tmp_path, 1_000_000))
    box.connected()
    return box


def test_what_is_sent_soon_is_live_and_what_waited_is_late(outbox: Outbox, monkeypatch: pytest.MonkeyPatch) -> None:
    """A message that waited is late, also on a connection that was never lost."""
    now = 1_000
    monkeypatch.setattr("time.monotonic_ns", lambda: now)
    outbox.store("snapshot", message(0))
    outbox.store("snapshot", message(1))
    letters = outbox.waiting()
    assert not next(letters).late
    now += LIVE_WITHIN_NS + 1
    assert next(letters).late


def test_what_is_sent_soon_is_live_also_behind_messages_of_an_earlier_process(tmp_path: Path) -> None:
    """The first message that a new process stores and sends is not late, whatever its place in the store is."""
    before = Outbox(Spool(tmp_path, 1_000_000))
    for number in range(3):
        before.store("snapshot", message(number))
    before.connected()
    for letter in before.waiting():
        before.sent(letter)
        before.acknowledged(letter)
    before.spool.close()
    after = Outbox(Spool(tmp_path, 1_000_000))
    after.connected()
    after.store("snapshot", message(3))
    (letter,) = after.waiting()
    assert (letter.index, letter.late) == (3, False)
    after.spool.close()


def test_only_the_newest_of_a_retained_topic_is_retained_when_late(outbox: Outbox) -> None:
    """An older state must not overwrite the current one at the broker."""
    outbox.store("node/3", message(0))
    outbox.store("node/3", message(1))
    outbox.store("snapshot", message(2))
    assert [letter.retain for letter in outbox.waiting()] == [True, True, False]
    outbox.connected()
    assert [(letter.retain, letter.late) for letter in outbox.waiting()] == [(False, True), (True, True), (False, True)]


def test_the_current_states_are_sent_again_in_a_new_connection(outbox: Outbox) -> None:
    """The retained messages that were acknowledged before are sent again, marked late."""
    outbox.store("node/3", message(0))
    outbox.store("alarm/bus", message(1))
    letter = next(outbox.waiting())
    outbox.sent(letter)
    outbox.acknowledged(letter)
    again = outbox.connected()
    assert set(again) == {"node/3"}
    assert b'"late":true' in again["node/3"]


def test_of_live_messages_the_newest_counts(outbox: Outbox) -> None:
    """A live message replaces a waiting one on the same topic."""
    outbox.add_live({"wheel/1": b"old", "wheel/2": b"old"})
    outbox.add_live({"wheel/1": b"new"})
    assert outbox.take_live() == {"wheel/1": b"new", "wheel/2": b"old"}
    assert outbox.take_live() == {}
    assert not outbox.live_arrived.is_set()


def test_measured_values_are_never_retained() -> None:
    """Neither `snapshot` nor `wheel/…` has the retain flag."""
    assert not any(is_retained(topic) for topic in ("snapshot", "wheel/1", "emcy", "event", "health"))
    assert all(is_retained(topic) for topic in ("state", "node/3", "alarm/bus"))
