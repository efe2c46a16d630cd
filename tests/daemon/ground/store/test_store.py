"""The store: each message once, means that do not depend on the order, limits, layouts."""

from __future__ import annotations

import random
import sqlite3
from typing import TYPE_CHECKING

import numpy as np
import pytest
from ground_messages import SESSION, START_NS, received

from regolithd.daemon.ground.settings import Store
from regolithd.daemon.ground.store import retention
from regolithd.daemon.ground.store.compression import compress, decompress, dictionary
from regolithd.daemon.ground.store.database import StoreError, lock, open_reader, open_writer
from regolithd.daemon.ground.store.messages import MessageStore
from regolithd.daemon.ground.store.retention import trim, used_bytes
from regolithd.daemon.ground.store.series import MOST_POINTS

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.daemon.ground.store.history import History

HOUR_NS = 3_600_000_000_000
DAY_NS = 24 * HOUR_NS


def test_a_repeated_message_is_stored_once(writer: sqlite3.Connection, history: History) -> None:
    """The same key again changes nothing, whatever its payload and however often; a new process knows it too."""
    messages = [received("posterior", number, number / 2) for number in range(5)]
    first = MessageStore(writer).add(messages)
    again = MessageStore(writer).add([received("posterior", 2, 1.0, late=True), *messages])
    assert [each.new for each in first] == [True] * 5
    assert [each.new for each in again] == [False] * 6
    assert [each.sequence for each in history.messages("kapvik", "posterior", 0, 2 * START_NS)] == [0, 1, 2, 3, 4]
    assert history.points("kapvik", "posterior", START_NS, START_NS + HOUR_NS).late.sum() == 0


def test_the_newest_message_of_a_topic_is_the_one_with_the_last_number(
    writer: sqlite3.Connection, history: History
) -> None:
    """Whatever arrived last; it is told as current, with its session, number and time."""
    MessageStore(writer).add([received("posterior", 4, 2.0), received("posterior", 3, 1.5, late=True)])
    newest = history.latest("kapvik")["posterior"]
    assert (newest.topic, newest.session, newest.sequence, newest.late) == ("posterior", SESSION, 4, False)
    assert newest.time_ns == START_NS + 2_000_000_000


def test_what_comes_late_goes_into_its_place(writer: sqlite3.Connection, history: History) -> None:
    """In any order of arrival the means are the same, and the back-filled ones are marked."""
    store = MessageStore(writer)
    values = [float(number % 7) for number in range(600)]
    live = [
        received("snapshot", number, number / 10, load_N=[value] * 6)
        for number, value in enumerate(values)
        if not 200 <= number < 300
    ]
    store.add(live)
    before = history.points("kapvik", "snapshot", START_NS, START_NS + HOUR_NS)
    late = [
        received("snapshot", number, number / 10, load_N=[values[number]] * 6, late=True) for number in range(200, 300)
    ]
    random.Random(1).shuffle(late)
    store.add(late)
    points = history.points("kapvik", "snapshot", START_NS, START_NS + HOUR_NS)
    assert (before.spacing_s, len(before.time_ms), len(points.time_ms)) == (2, 25, 30)
    np.testing.assert_allclose(points.values[:, 0], np.array(values).reshape(30, 20).mean(1))
    assert points.late.tolist() == [0.0] * 10 + [1.0] * 5 + [0.0] * 15


def test_a_short_range_has_every_message_and_a_long_one_few_points(
    writer: sqlite3.Connection, history: History
) -> None:
    """Up to some minutes at 10 Hz each message is a point; whatever the range, there are at most `MOST_POINTS`."""
    store = MessageStore(writer)
    store.add(received("snapshot", number, number * 30.0) for number in range(4000))
    short = history.points("kapvik", "snapshot", START_NS, START_NS + 240_000_000_000)
    assert (short.spacing_s, len(short.time_ms)) == (0, 9)
    for days in (0.05, 0.3, 1.4):
        points = history.points("kapvik", "snapshot", START_NS, START_NS + int(days * DAY_NS))
        assert 100 < len(points.time_ms) <= MOST_POINTS


def test_missing_values_are_left_out_of_the_means(writer: sqlite3.Connection, history: History) -> None:
    """A wheel that was not measured has no value, and does not change the mean of what was measured."""
    slips = ([0.1] * 6, [None] * 6, [0.3, None, 0.3, 0.3, 0.3, 0.3])
    MessageStore(writer).add(received("snapshot", number, number / 10, slip=slip) for number, slip in enumerate(slips))
    points = history.points("kapvik", "snapshot", START_NS - HOUR_NS, START_NS + HOUR_NS)
    assert points.values[0, 6:8].tolist() == pytest.approx([0.2, 0.1])


def test_the_newest_message_of_a_topic_is_that_with_the_largest_key(
    writer: sqlite3.Connection, history: History
) -> None:
    """A death follows its birth, an older connection's death does not, and a later session is newer."""
    store = MessageStore(writer)

    def state(sequence: int, word: str, session: str = SESSION) -> bool:
        (stored,) = store.add([received("state", sequence, state=word, session=session)])
        return stored.newest

    assert state(1, "online")
    assert state(1, "offline")
    assert state(2, "online")
    assert not state(1, "offline")
    assert state(1, "online", "20261123T000000Z-bbbb")
    assert not state(2, "offline")
    assert b'"online"' in history.latest("kapvik")["state"].payload


def test_the_oldest_messages_go_first(writer: sqlite3.Connection, history: History) -> None:
    """Beyond the size the oldest go until it fits, beyond the age what is older, with the finest means."""
    store = MessageStore(writer)
    for batch in range(0, 20_000, 1000):
        store.add(
            received("event", batch + k, batch + k, text=random.Random(k).randbytes(500).hex()) for k in range(1000)
        )
    size = used_bytes(writer)
    limits = Store.model_construct(limit_MB=size / 2e6, keep_days=90.0)
    now_ns = START_NS + 20_000_000_000_000
    while trim(writer, limits, now_ns):
        pass
    kept = [each.sequence for each in history.messages("kapvik", "event", 0, 2 * START_NS)]
    assert used_bytes(writer) <= size / 2
    assert kept == list(range(kept[0], 20_000))
    assert 5000 < kept[0] < 15_000
    while trim(writer, Store(keep_days=1000 / 86_400), now_ns):
        pass
    assert [each.sequence for each in history.messages("kapvik", "event", 0, 2 * START_NS)] == list(
        range(19_000, 20_000)
    )


@pytest.mark.parametrize(("bytes_over", "deleted"), [(-1, 0), (0, 0), (1, 3)])
def test_a_store_may_be_as_large_as_its_limit(
    bytes_over: int, deleted: int, writer: sqlite3.Connection, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beyond it the messages go that were received first, however new they are."""
    MessageStore(writer).add([received("event", number, float(number)) for number in range(3)])
    monkeypatch.setattr(retention, "used_bytes", lambda _: 20_000_000 + bytes_over)
    assert trim(writer, Store(limit_MB=20.0), START_NS) == deleted


def test_payloads_are_small_and_come_back_whole(writer: sqlite3.Connection) -> None:
    """A snapshot takes less than a third of its JSON; one that cannot be compressed is stored as it is."""
    payload = received("snapshot", 1).payload
    words = dictionary()
    assert len(compress(payload, words)) < len(payload) / 3
    noise = random.Random(1).randbytes(300)
    for each in (payload, noise, b""):
        assert decompress(compress(each, words), words) == each
    assert len(compress(noise, words)) == 301
    assert writer.execute("SELECT value FROM setting").fetchone() == (words,)


def test_a_failed_batch_leaves_nothing_behind(writer: sqlite3.Connection, history: History) -> None:
    """An error in the middle undoes the batch, also its names, so that it can be stored again."""
    store = MessageStore(writer)

    def failing() -> object:
        yield received("event", 0, rover="new")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        store.add(failing())  # type: ignore[arg-type]
    assert history.rovers() == []
    assert [each.new for each in store.add([received("event", 0, rover="new")])] == [True]
    assert [each.sequence for each in history.newest("new", "event", 5)] == [0]


def test_a_store_that_cannot_be_used_says_why(tmp_path: Path) -> None:
    """No database, another layout, a second writer: one message with the file and what to change."""
    (tmp_path / "text").write_text("no database, but a text of more than a hundred bytes. " * 5)
    with pytest.raises(StoreError, match=r"file is not a database\. Set \[store\] directory"):
        open_writer(tmp_path / "text")
    connection = sqlite3.connect(tmp_path / "newer")
    connection.execute("PRAGMA user_version = 9")
    connection.close()
    with pytest.raises(StoreError, match="has layout 9, and this version reads 1"):
        open_writer(tmp_path / "newer")
    with lock(tmp_path / "folder"), pytest.raises(StoreError, match="in use by another"):
        lock(tmp_path / "folder")
    lock(tmp_path / "folder").close()


def test_a_reader_cannot_write(writer: sqlite3.Connection, tmp_path: Path) -> None:
    """Downloads and plots cannot change what is stored."""
    assert writer
    reader = open_reader(tmp_path / "ground.sqlite")
    with pytest.raises(sqlite3.OperationalError):
        reader.execute("DELETE FROM message")
    reader.close()
