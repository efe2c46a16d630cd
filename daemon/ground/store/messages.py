"""Stores messages: each once, whatever arrives twice, with the newest of each topic and the means over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.ground.store.compression import compress
from regolithd.daemon.ground.store.database import words_of
from regolithd.daemon.ground.store.series import SERIES, SPANS_S, Bucket

if TYPE_CHECKING:
    import sqlite3
    from collections.abc import Iterable

    from regolithd.daemon.ground.received import Received
    from regolithd.daemon.ground.store.series import Array


@dataclass(frozen=True, slots=True)
class Stored:
    """What became of a message: `new` unless it had been stored before, `newest` if it is its topic's newest."""

    message: Received
    new: bool
    newest: bool


class MessageStore:
    """The one writer of messages."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._words = words_of(connection)
        self._ids: dict[tuple[str, ...], int] = {}
        self._newest: dict[int, tuple[str, int]] = {
            topic: (session, sequence)
            for topic, session, sequence in connection.execute("SELECT topic, session, sequence FROM latest")
        }

    def add(self, messages: Iterable[Received]) -> list[Stored]:
        """Store messages in one transaction; once this returns they survive the end of the process."""
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            stored = [self._add(message) for message in messages]
        except BaseException:
            self._connection.execute("ROLLBACK")
            self._ids.clear()
            raise
        self._connection.execute("COMMIT")
        return stored

    def _add(self, message: Received) -> Stored:
        rover = self._id("rover", "name", message.rover)
        topic = self._id("topic", "rover, name", str(rover), message.topic)
        session = self._id("session", "name", message.session)
        row = (topic, session, message.sequence, message.time_ns, message.late, compress(message.payload, self._words))
        added = self._connection.execute("INSERT OR IGNORE INTO message VALUES (NULL, ?, ?, ?, ?, ?, ?)", row).rowcount
        newest = message.key > self._newest.get(topic, ("", -1))
        if newest:
            self._newest[topic] = message.key
            self._connection.execute(
                "INSERT OR REPLACE INTO latest VALUES (?, ?, ?, ?, ?)",
                (topic, *message.key, message.time_ns, message.payload),
            )
        if added and message.channel in SERIES:
            self._add_to_buckets(rover, session, message)
        return Stored(message, bool(added), newest)

    def _id(self, table: str, columns: str, *values: str) -> int:
        key = (table, *values)
        if key not in self._ids:
            marks = ", ".join("?" * len(values))
            where = " AND ".join(f"{column} = ?" for column in columns.split(", "))
            self._connection.execute(f"INSERT OR IGNORE INTO {table} ({columns}) VALUES ({marks})", values)  # noqa: S608  # names are constants
            found = self._connection.execute(f"SELECT id FROM {table} WHERE {where}", values).fetchone()  # noqa: S608
            self._ids[key] = int(found[0])
        return self._ids[key]

    def _add_to_buckets(self, rover: int, session: int, message: Received) -> None:
        series = SERIES[message.channel]
        values: Array = np.array(series.values(message.content))
        second = message.time_ns // 1_000_000_000
        for span_s in SPANS_S:
            key = (rover, series.channel, span_s, second - second % span_s, session)
            found = self._connection.execute(
                "SELECT sums, late FROM bucket WHERE rover = ? AND series = ? AND span_s = ? AND start_s = ?"
                " AND session = ?",
                key,
            ).fetchone()
            bucket = Bucket.from_bytes(*found) if found else Bucket.empty(series)
            bucket = bucket.add(values, late=message.late)
            self._connection.execute(
                "INSERT OR REPLACE INTO bucket VALUES (?, ?, ?, ?, ?, ?, ?)",
                (*key, bucket.late, bucket.sums.tobytes()),
            )
