"""Opens the database and creates its tables.

The journal is a write-ahead log: a process that is killed loses nothing that was committed, and readers never wait for
the writer. One task writes, through `open_writer`; others read through connections of their own.
"""

from __future__ import annotations

import fcntl
import sqlite3
from typing import TYPE_CHECKING

from regolithd.daemon.ground.store.compression import dictionary

if TYPE_CHECKING:
    from io import TextIOWrapper
    from pathlib import Path

LAYOUT = 1
"""Version of the tables (`PRAGMA user_version`)."""

TABLES = """
CREATE TABLE setting (name TEXT PRIMARY KEY, value BLOB NOT NULL);
CREATE TABLE rover (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE topic (id INTEGER PRIMARY KEY, rover INTEGER NOT NULL, name TEXT NOT NULL, UNIQUE (rover, name));
CREATE TABLE session (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE message (
    id INTEGER PRIMARY KEY,
    topic INTEGER NOT NULL, session INTEGER NOT NULL, sequence INTEGER NOT NULL,
    time_ns INTEGER NOT NULL, late INTEGER NOT NULL, payload BLOB NOT NULL,
    UNIQUE (topic, session, sequence)
);
CREATE INDEX message_time ON message (topic, time_ns);
CREATE TABLE latest (
    topic INTEGER PRIMARY KEY, session TEXT NOT NULL, sequence INTEGER NOT NULL, time_ns INTEGER NOT NULL,
    payload BLOB NOT NULL
);
CREATE TABLE bucket (
    rover INTEGER NOT NULL, series TEXT NOT NULL, span_s INTEGER NOT NULL, start_s INTEGER NOT NULL,
    session INTEGER NOT NULL, late INTEGER NOT NULL, sums BLOB NOT NULL,
    PRIMARY KEY (rover, series, span_s, start_s, session)
) WITHOUT ROWID;
CREATE TABLE alarm_entry (
    id INTEGER PRIMARY KEY, rover TEXT NOT NULL, name TEXT NOT NULL, time_ns INTEGER NOT NULL, entry TEXT NOT NULL
);
CREATE INDEX alarm_entry_time ON alarm_entry (rover, time_ns);
CREATE TABLE login (token BLOB PRIMARY KEY, user TEXT NOT NULL, until_s INTEGER NOT NULL);
"""


class StoreError(OSError):
    """The database cannot be used."""


def lock(folder: Path) -> TextIOWrapper:
    """Lock a store's folder for this process; closing the returned file, or the end of the process, unlocks it.

    Raises
    ------
    StoreError
        The folder cannot be written, or another process has the lock.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / "lock").open("a", encoding="ascii")
    except OSError as error:
        raise StoreError(f"{folder}: {error.strerror}. Set [store] directory to a folder that you may write") from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.close()
        raise StoreError(
            f"{folder} is in use by another `regolithd ground`: stop it, or set [store] directory"
        ) from error
    return file


def open_writer(path: Path) -> sqlite3.Connection:
    """Open the database for its one writer, which has the folder's lock; create the tables where they are missing.

    Raises
    ------
    StoreError
        The file cannot be written, is no database, or of another layout.
    """
    try:
        connection = sqlite3.connect(path, isolation_level=None, timeout=1.0)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")
        _create(connection, path)
    except (OSError, sqlite3.Error) as error:
        if isinstance(error, StoreError):
            raise
        raise StoreError(f"{path}: {error}. Set [store] directory to a folder that you may write") from error
    return connection


def _create(connection: sqlite3.Connection, path: Path) -> None:
    layout = connection.execute("PRAGMA user_version").fetchone()[0]
    if layout == 0:
        connection.executescript(f"BEGIN; {TABLES} PRAGMA user_version = {LAYOUT}; COMMIT;")
        connection.execute("INSERT INTO setting VALUES ('dictionary', ?)", (dictionary(),))
    elif layout != LAYOUT:
        raise StoreError(f"{path} has layout {layout}, and this version reads {LAYOUT}: set another [store] directory")


def open_reader(path: Path) -> sqlite3.Connection:
    """Open the database for reading, in any thread."""
    connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=5.0, check_same_thread=False)
    connection.execute("PRAGMA query_only = ON")
    return connection


def words_of(connection: sqlite3.Connection) -> bytes:
    """Return the compression dictionary with which this database was created."""
    return bytes(connection.execute("SELECT value FROM setting WHERE name = 'dictionary'").fetchone()[0])
