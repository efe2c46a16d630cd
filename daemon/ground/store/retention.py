"""Keeps the store within its limits: what is too old goes, and the oldest goes when the database is too large."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.daemon.ground.store.series import SERIES, SPANS_S

if TYPE_CHECKING:
    import sqlite3

    from regolithd.daemon.ground.settings import Store

BATCH = 2000
"""Messages that are deleted at a time; about 20 ms."""
_DAY_NS = 86_400_000_000_000


def used_bytes(connection: sqlite3.Connection) -> int:
    """Return the size of what is stored. Deleted pages are used again: the file itself does not shrink."""
    pages, free, size = (
        connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("page_count", "freelist_count", "page_size")
    )
    return int((pages - free) * size)


def trim(connection: sqlite3.Connection, limits: Store, now_ns: int) -> int:
    """Delete one batch of what is beyond the limits; return how many messages, 0 once it is within them.

    Only the messages that were received first are looked at: a search by time would read the whole store.
    """
    oldest_ns = now_ns - int(limits.keep_days * _DAY_NS)
    too_large = used_bytes(connection) > limits.limit_MB * 1e6
    rows = connection.execute(f"SELECT id, time_ns FROM message ORDER BY id LIMIT {BATCH}").fetchall()  # noqa: S608
    if not too_large:
        rows = [row for row in rows if row[1] < oldest_ns]
    connection.execute("BEGIN IMMEDIATE")
    connection.executemany("DELETE FROM message WHERE id = ?", [(row[0],) for row in rows])
    if rows:
        _delete_buckets(connection, SPANS_S[:1], rows[-1][1] // 1_000_000_000)
    _delete_buckets(connection, SPANS_S, oldest_ns // 1_000_000_000)
    connection.execute("COMMIT")
    return len(rows)


def _delete_buckets(connection: sqlite3.Connection, spans_s: tuple[int, ...], before_s: int) -> None:
    """Delete the means before a time [s]. The shortest go with their messages, the others after `keep_days`."""
    for span_s in spans_s:
        for series in SERIES:
            connection.execute(
                "DELETE FROM bucket WHERE rover IN (SELECT id FROM rover)"
                " AND series = ? AND span_s = ? AND start_s < ?",
                (series, span_s, before_s),
            )
