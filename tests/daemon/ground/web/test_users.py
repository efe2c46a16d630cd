"""Users: hashes, the file, sessions, and waiting after wrong passwords."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from regolithd.daemon.ground.web.users import (
    FAILURES_WITHIN_S,
    MOST_FAILURES,
    SESSION_S,
    Logins,
    PasswordHash,
    UsersError,
    add_user,
    read_users,
)

if TYPE_CHECKING:
    import sqlite3
    from pathlib import Path

PASSWORD = "difference engine"


def test_a_user_is_added_and_the_password_is_not_in_the_file(tmp_path: Path) -> None:
    """The file is readable by its owner only; a second password replaces the first; others stay."""
    path = tmp_path / "users"
    add_user(path, "ada", PASSWORD)
    add_user(path, "bob", "another long one")
    add_user(path, "ada", "analytical engine")
    users = read_users(path)
    assert list(users) == ["ada", "bob"]
    assert users["ada"].matches("analytical engine")
    assert not users["ada"].matches(PASSWORD)
    assert path.stat().st_mode & 0o777 == 0o600
    assert "engine" not in path.read_text()


def test_equal_passwords_have_different_hashes() -> None:
    """Each hash has a salt of its own."""
    assert PasswordHash.of(PASSWORD).key != PasswordHash.of(PASSWORD).key


@pytest.mark.parametrize(("name", "password"), [("a:b", PASSWORD), ("", PASSWORD), ("ada", "short")])
def test_names_and_passwords_that_cannot_be_are_refused(tmp_path: Path, name: str, password: str) -> None:
    """The file is not written."""
    with pytest.raises(UsersError):
        add_user(tmp_path / "users", name, password)
    assert not (tmp_path / "users").exists()


def test_a_damaged_file_is_reported_with_its_line(tmp_path: Path) -> None:
    """A line that is no user ends the start, with file and line."""
    path = tmp_path / "users"
    add_user(path, "ada", PASSWORD)
    path.write_text(path.read_text() + "bob:plain\n")
    with pytest.raises(UsersError, match="users:2: not a user"):
        read_users(path)


def test_a_session_ends_and_a_removed_user_has_none(writer: sqlite3.Connection) -> None:
    """A token counts until its end, in another process too, and only while the user is in the file."""
    now = [1000.0]
    users = {"ada": PasswordHash.of(PASSWORD)}
    token = Logins(users, writer, lambda: now[0]).begin("ada", "here")
    logins = Logins(users, writer, lambda: now[0])
    assert [logins.user(each) for each in (token, token + "x", "", None)] == ["ada", None, None, None]
    assert Logins({}, writer, lambda: now[0]).user(token) is None
    now[0] += SESSION_S + 1
    assert logins.user(token) is None
    assert token not in str(writer.execute("SELECT * FROM login").fetchall())


def test_after_five_wrong_passwords_an_address_waits(writer: sqlite3.Connection) -> None:
    """Others are not held up, and after the time it may try again."""
    now = [1000.0]
    logins = Logins({}, writer, lambda: now[0])
    for _ in range(MOST_FAILURES):
        assert logins.blocked_s("there") == 0
        assert not logins.is_right("ada", PASSWORD)
        logins.failed("there")
    assert logins.blocked_s("there") == FAILURES_WITHIN_S
    assert logins.blocked_s("here") == 0
    now[0] += FAILURES_WITHIN_S
    assert logins.blocked_s("there") == 0


def test_a_folder_that_cannot_be_written_is_one_message(tmp_path: Path) -> None:
    """It has the key of ground.toml that names the file."""
    (tmp_path / "file").touch()
    with pytest.raises(UsersError, match=r"Set \[page\] users to a file that you may write"):
        add_user(tmp_path / "file" / "users", "ada", PASSWORD)


def test_a_file_that_is_no_text_is_one_message(tmp_path: Path) -> None:
    """It has the command that makes one."""
    (tmp_path / "users").write_bytes(b"\xff\xfe")
    for name in ("users", "absent"):
        with pytest.raises(UsersError, match="--add-user NAME"):
            read_users(tmp_path / name)


def test_the_first_of_five_wrong_passwords_counts(writer: sqlite3.Connection) -> None:
    """An address waits until that one is long enough ago, and a sixth makes the second one count."""
    now = [1000.0]
    logins = Logins({}, writer, lambda: now[0])
    for _ in range(MOST_FAILURES):
        logins.failed("there")
        now[0] += 10
    assert logins.blocked_s("there") == FAILURES_WITHIN_S - 10 * MOST_FAILURES
    logins.failed("there")
    assert logins.blocked_s("there") == FAILURES_WITHIN_S - 10 * (MOST_FAILURES - 1)
