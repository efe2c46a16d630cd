"""Users and their sessions: passwords as scrypt hashes in a file, sessions as hashed tokens in the database.

A line of the file is `NAME:scrypt:LOG2_N:R:P:SALT:HASH`, salt and hash in hexadecimal (RFC 7914).
"""

from __future__ import annotations

import hashlib
import hmac
import os
import re
import secrets
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sqlite3
    from collections.abc import Callable
    from pathlib import Path

NAME = re.compile(r"[\w.@-]{1,64}")
SHORTEST_PASSWORD = 10
SESSION_S = 7 * 86_400
LOG2_N, BLOCK_SIZE, PARALLEL = 15, 8, 1
"""Cost of scrypt: 32 MB and some 60 ms for each attempt."""
MOST_FAILURES, FAILURES_WITHIN_S = 5, 300.0


class UsersError(Exception):
    """The file of users cannot be used, or a name or password is refused."""


@dataclass(frozen=True, slots=True)
class PasswordHash:
    """A salted hash of a password, with its cost."""

    log2_n: int
    block_size: int
    parallel: int
    salt: bytes
    key: bytes

    @classmethod
    def of(cls, password: str) -> PasswordHash:
        """Return the hash of a new password."""
        salt = secrets.token_bytes(16)
        return cls(LOG2_N, BLOCK_SIZE, PARALLEL, salt, _scrypt(password, salt, LOG2_N, BLOCK_SIZE, PARALLEL))

    def matches(self, password: str) -> bool:
        """Return whether this is the password's hash, in constant time."""
        return hmac.compare_digest(self.key, _scrypt(password, self.salt, self.log2_n, self.block_size, self.parallel))

    def __str__(self) -> str:
        """Return the hash as the file has it."""
        return f"scrypt:{self.log2_n}:{self.block_size}:{self.parallel}:{self.salt.hex()}:{self.key.hex()}"


def _scrypt(password: str, salt: bytes, log2_n: int, block_size: int, parallel: int) -> bytes:
    return hashlib.scrypt(
        password.encode(), salt=salt, n=1 << log2_n, r=block_size, p=parallel, maxmem=1 << 28, dklen=32
    )


_NOBODY = PasswordHash(LOG2_N, BLOCK_SIZE, PARALLEL, bytes(16), bytes(32))
"""Compared with where there is no such user, so that the answer takes as long."""


def read_users(path: Path) -> dict[str, PasswordHash]:
    """Return name → hash.

    Raises
    ------
    UsersError
        The file cannot be read, or has a line of another form.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise UsersError(f"{path}: {error}. Add a user with `regolithd ground --add-user NAME`") from error
    users = {}
    for number, line in enumerate(lines, start=1):
        try:
            name, _, log2_n, block_size, parallel, salt, key = line.split(":")
            users[name] = PasswordHash(
                int(log2_n), int(block_size), int(parallel), bytes.fromhex(salt), bytes.fromhex(key)
            )
        except ValueError as error:
            raise UsersError(f"{path}:{number}: not a user. Remove the line, and add the user again") from error
    return users


def add_user(path: Path, name: str, password: str) -> None:
    """Add a user to the file, or replace the user's password; nobody but its owner may read the file.

    Raises
    ------
    UsersError
        The name or the password is refused, or the file cannot be used.
    """
    if not NAME.fullmatch(name):
        raise UsersError(f"{name!r} is no user name: letters, digits and . _ @ -, at most 64")
    if len(password) < SHORTEST_PASSWORD:
        raise UsersError(f"the password is too short: at least {SHORTEST_PASSWORD} characters")
    users = read_users(path) if path.exists() else {}
    users[name] = PasswordHash.of(password)
    text = "".join(f"{each}:{stored}\n" for each, stored in users.items())
    draft = path.with_name(f"{path.name}.new")
    try:
        draft.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as file:
            file.write(text)
        draft.replace(path)
    except OSError as error:
        raise UsersError(f"{path}: {error.strerror}. Set [page] users to a file that you may write") from error


class Logins:
    """Checks passwords, and keeps sessions in the database: they survive a restart of the ground."""

    def __init__(
        self, users: dict[str, PasswordHash], connection: sqlite3.Connection, clock_s: Callable[[], float]
    ) -> None:
        self._users = users
        self._connection = connection
        self._clock_s = clock_s
        self._failures: dict[str, deque[float]] = {}

    def blocked_s(self, address: str) -> float:
        """Return how long an address has to wait after too many wrong passwords [s]; 0: it may try."""
        failures = self._failures.get(address, deque())
        left = failures[0] + FAILURES_WITHIN_S - self._clock_s() if len(failures) == MOST_FAILURES else 0.0
        return max(0.0, left)

    def is_right(self, name: str, password: str) -> bool:
        """Return whether name and password belong together. Takes some 60 ms: call it in a thread."""
        return self._users.get(name, _NOBODY).matches(password) and name in self._users

    def failed(self, address: str) -> None:
        """Note a wrong password."""
        self._failures.setdefault(address, deque(maxlen=MOST_FAILURES)).append(self._clock_s())

    def begin(self, name: str, address: str) -> str:
        """Begin a session; return the token for the cookie."""
        self._failures.pop(address, None)
        token = secrets.token_urlsafe(32)
        self._connection.execute("DELETE FROM login WHERE until_s < ?", (self._clock_s(),))
        until_s = int(self._clock_s() + SESSION_S)
        self._connection.execute("INSERT INTO login VALUES (?, ?, ?)", (_hashed(token), name, until_s))
        return token

    def user(self, token: str | None) -> str | None:
        """Return the user of a session, None if there is no such session or user any more."""
        if not token:
            return None
        found = self._connection.execute(
            "SELECT user FROM login WHERE token = ? AND until_s > ?", (_hashed(token), self._clock_s())
        ).fetchone()
        return found[0] if found and found[0] in self._users else None

    def end(self, token: str) -> None:
        """End a session."""
        self._connection.execute("DELETE FROM login WHERE token = ?", (_hashed(token),))


def _hashed(token: str) -> bytes:
    return hashlib.sha256(token.encode()).digest()
