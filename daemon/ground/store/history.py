"""Reads what is stored: series for plots, newest messages, messages of a time range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic_core import from_json

from regolithd.daemon.ground.store.compression import decompress
from regolithd.daemon.ground.store.database import words_of
from regolithd.daemon.ground.store.series import MOST_POINTS, SERIES, SPANS_S, Bucket

if TYPE_CHECKING:
    import sqlite3
    from collections.abc import Iterator

    from regolithd.daemon.ground.store.series import Array, Series

_NS = 1_000_000_000
RAW_RATE_HZ = 10.0
"""Up to this rate of messages `MOST_POINTS` is kept where every single message is drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """A series in a time range, oldest first.

    Attributes
    ----------
    spacing_s
        Span that each point is the mean of; 0: each point is one message.
    time_ms, late
        Shape (points,): time, and whether late messages are in it.
    session
        Shape (points,): number of the session in which it was measured.
    values
        Shape (points, names of the series).
    """

    spacing_s: int
    time_ms: Array
    late: Array
    session: Array
    values: Array


@dataclass(frozen=True, slots=True)
class Message:
    """A stored message."""

    topic: str
    session: str
    sequence: int
    time_ns: int
    late: bool
    payload: bytes


class History:
    """Reads one database; each thread has an object of its own."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._words = words_of(connection)

    def rovers(self) -> list[str]:
        """Return the names of all rovers that ever published."""
        return [name for (name,) in self._connection.execute("SELECT name FROM rover ORDER BY name")]

    def latest(self, rover: str) -> dict[str, Message]:
        """Return topic → its newest message."""
        rows = self._connection.execute(
            "SELECT topic.name, session, sequence, time_ns, payload FROM latest JOIN topic ON topic.id = latest.topic"
            " JOIN rover ON rover.id = topic.rover WHERE rover.name = ? ORDER BY topic.name",
            (rover,),
        )
        return {
            topic: Message(topic, session, sequence, time_ns, late=False, payload=payload)
            for topic, session, sequence, time_ns, payload in rows
        }

    def points(self, rover: str, channel: str, from_ns: int, to_ns: int) -> Points:
        """Return a series of `SERIES` in a time range, as fine as `MOST_POINTS` allow."""
        series = SERIES[channel]
        range_s = (to_ns - from_ns) / _NS
        if range_s * RAW_RATE_HZ <= MOST_POINTS:
            return self._single(rover, series, from_ns, to_ns)
        span_s = next((span for span in SPANS_S if range_s / span <= MOST_POINTS), SPANS_S[-1])
        return self._means(rover, series, span_s, from_ns, to_ns)

    def _single(self, rover: str, series: Series, from_ns: int, to_ns: int) -> Points:
        rows = self._connection.execute(
            "SELECT time_ns, late, session, payload FROM message WHERE topic ="
            " (SELECT topic.id FROM topic JOIN rover ON rover.id = topic.rover"
            " WHERE rover.name = ? AND topic.name = ?) AND time_ns BETWEEN ? AND ? ORDER BY time_ns",
            (rover, series.channel, from_ns, to_ns),
        ).fetchall()
        values = [series.values(from_json(decompress(row[3], self._words))) for row in rows]
        return _points(0, [row[0] / 1e6 for row in rows], rows, values, series)

    def _means(self, rover: str, series: Series, span_s: int, from_ns: int, to_ns: int) -> Points:
        rows = self._connection.execute(
            "SELECT start_s, late, session, sums FROM bucket WHERE rover = (SELECT id FROM rover WHERE name = ?)"
            " AND series = ? AND span_s = ? AND start_s BETWEEN ? AND ? ORDER BY start_s, session",
            (rover, series.channel, span_s, from_ns // _NS - span_s, to_ns // _NS),
        ).fetchall()
        values = [Bucket.from_bytes(row[3], row[1]).mean for row in rows]
        return _points(span_s, [1000.0 * (row[0] + span_s / 2) for row in rows], rows, values, series)

    def messages(self, rover: str, topic: str, from_ns: int, to_ns: int) -> Iterator[Message]:
        """Yield the messages of a topic, or of a pattern such as `alarm/*`, in a time range, oldest first."""
        return self._select(rover, topic, "AND time_ns BETWEEN ? AND ? ORDER BY time_ns, sequence", (from_ns, to_ns))

    def newest(self, rover: str, topic: str, count: int) -> list[Message]:
        """Return the newest messages of a topic or pattern, newest first."""
        return list(self._select(rover, topic, "ORDER BY time_ns DESC, sequence DESC LIMIT ?", (count,)))

    def _select(self, rover: str, topic: str, rest: str, values: tuple[int, ...]) -> Iterator[Message]:
        names = dict(
            self._connection.execute(
                "SELECT topic.id, topic.name FROM topic JOIN rover ON rover.id = topic.rover"
                " WHERE rover.name = ? AND topic.name GLOB ?",
                (rover, topic),
            ).fetchall()
        )
        marks = ", ".join("?" * len(names))
        rows = self._connection.execute(
            "SELECT topic, session.name, sequence, time_ns, late, payload FROM message"  # noqa: S608  # marks are "?"
            f" JOIN session ON session.id = message.session WHERE topic IN ({marks}) {rest}",
            (*names, *values),
        )
        for number, session, sequence, time_ns, late, payload in rows:
            yield Message(names[number], session, sequence, time_ns, bool(late), decompress(payload, self._words))


def _points(spacing_s: int, time_ms: list[float], rows: list[Any], values: list[Any], series: Series) -> Points:
    return Points(
        spacing_s=spacing_s,
        time_ms=np.array(time_ms),
        late=np.array([row[1] > 0 for row in rows], float),
        session=np.array([row[2] for row in rows], float),
        values=np.array(values, float).reshape(len(rows), len(series.names)),
    )
