"""Faults by command from outside the process: a UNIX socket, one line in, one answer out.

A line is one of `drivers.virtual.fault_injection`. Every answer ends with an empty line.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from pathlib import Path

    from regolithd.drivers.virtual.rover import VirtualRover


class ControlError(OSError):
    """Nobody listens at the socket, or somebody else does already."""


@contextlib.asynccontextmanager
async def control_socket(rover: VirtualRover, path: Path) -> AsyncIterator[None]:
    """Obey the lines that come through `path`, which only this user may open, for the time of the context."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while line := await reader.readline():
                writer.write(f"{rover.tell(line.decode(errors='replace'))}\n\n".encode())
                await writer.drain()
        writer.close()

    _make_room(path)
    before = os.umask(0o177)
    try:
        server = await asyncio.start_unix_server(serve, path)
    except OSError as error:
        raise ControlError(f"{path}: {error.strerror}") from error
    finally:
        os.umask(before)
    try:
        yield
    finally:
        server.close()
        _remove(path)


def ask(path: Path, line: str, timeout_s: float = 5.0) -> str:
    """Send one command and return the answer.

    Raises
    ------
    ControlError
        There is no virtual rover at this socket.
    """
    try:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(timeout_s)
            connection.connect(str(path))
            connection.sendall(f"{line}\n".encode())
            answer = b""
            while not answer.endswith(b"\n\n"):
                part = connection.recv(65536)
                if not part:
                    break
                answer += part
    except OSError as error:
        raise ControlError(f"{path}: {error}. Is `regolithd bench` running, with this --control?") from error
    return answer.decode().strip("\n")


def _make_room(path: Path) -> None:
    """Remove the socket of a virtual rover that is no more."""
    if _answers(path):
        raise ControlError(f"{path}: a virtual rover listens there already; give this one another --control")
    _remove(path)


def _remove(path: Path) -> None:
    path.unlink(missing_ok=True)


def _answers(path: Path) -> bool:
    try:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(1.0)
            connection.connect(str(path))
    except OSError:
        return False
    return True
