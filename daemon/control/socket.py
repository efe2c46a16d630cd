"""Creates the control socket's file: it appears once it listens, with its permissions, never with wider ones."""

from __future__ import annotations

import grp
import os
import secrets
import socket
import stat
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

MODE = 0o660


class ControlSocketError(Exception):
    """The control socket cannot be created; the message says why, and what to do."""


def group_id(group: str) -> int:
    """Return the number of a group, given its name or number."""
    try:
        return int(group) if group.isdigit() else grp.getgrnam(group).gr_gid
    except KeyError:
        remedy = f"Create it (`groupadd --system {group}`), or name another: [control] group."
        raise ControlSocketError(f"there is no group {group!r}. {remedy}") from None


def open_control_socket(path: Path, group: str) -> socket.socket:
    """Return a listening socket at `path`, which only the group's members (and root) may open."""
    remedy = f"The daemon's user must own the folder and be a member of {group!r}: [control] socket and group."
    return open_socket(path, MODE, group_id(group), remedy)


def open_socket(path: Path, mode: int, group: int | None = None, remedy: str = "") -> socket.socket:
    """Return a listening socket at `path` with these permissions, and this group's number.

    It is bound beside `path` and linked to it when it listens: a client that finds the file gets an answer.

    Raises
    ------
    ControlSocketError
        It cannot be created; the message ends with `remedy`.
    """
    _remove_stale(path)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)
    bound = path.with_name(f".{secrets.token_hex(4)}")  # short: a socket's path has at most 107 bytes, unix(7)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        mask = os.umask(0o177)  # only the daemon's user, until the group is set
        try:
            listener.bind(str(bound))
        finally:
            os.umask(mask)
        if group is not None and bound.stat().st_gid != group:
            os.chown(bound, -1, group)
        bound.chmod(mode)
        listener.listen(8)
        os.link(bound, path)  # unlike a rename, it does not replace the socket of a daemon that starts meanwhile
    except OSError as error:
        listener.close()
        raise ControlSocketError(f"{path}: {error.strerror or error}. {remedy}".rstrip()) from error
    finally:
        bound.unlink(missing_ok=True)
    return listener


def _remove_stale(path: Path) -> None:
    """Remove the socket of a daemon that was killed; refuse if a daemon answers on it, or if it is no socket."""
    try:
        if not stat.S_ISSOCK(path.lstat().st_mode):
            raise ControlSocketError(f"{path}: is not a socket. Choose another path: [control] socket.")
    except OSError:
        return  # there is no file, or bind will fail with the reason
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
        except OSError as error:
            raise ControlSocketError(f"{path}: {error.strerror}.") from error
        else:
            raise ControlSocketError(f"{path}: another regolithd answers there. Stop that process first.")
