"""Fault injection from another process: a UNIX socket that takes one command a line.

The commands are those of `drivers.virtual.fault_injection`. Every answer ends with an empty line.
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


ANSWER_TIMEOUT_S = 5.0
CONNECT_TIMEOUT_S = 1.0


class FaultSocketError(OSError):
    """No virtual rover listens at the socket, or another one already does."""


@contextlib.asynccontextmanager
async def fault_socket(rover: VirtualRover, path: Path) -> AsyncIterator[None]:
    """Execute commands that arrive at the socket `path`, which only this user may open, until the context ends."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while line := await reader.readline():
                writer.write(f"{rover.inject_fault(line.decode(errors='replace'))}\n\n".encode())
                await writer.drain()
        writer.close()

    _remove_stale(path)
    before = os.umask(0o177)
    try:
        server = await asyncio.start_unix_server(serve, path)
    except OSError as error:
        raise FaultSocketError(f"{path}: {error.strerror}") from error
    finally:
        os.umask(before)
    try:
        yield
    finally:
        server.close()
        _remove(path)


def send_command(path: Path, line: str, timeout_s: float = ANSWER_TIMEOUT_S) -> str:
    """Send one command and return the answer.

    Raises
    ------
    FaultSocketError
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
        raise FaultSocketError(f"{path}: {error}. Is `regolithd bench` running, with this --control?") from error
    return answer.decode().strip("\n")


def _remove_stale(path: Path) -> None:
    """Remove the socket that a terminated virtual rover left behind."""
    if _answers(path):
        raise FaultSocketError(f"{path}: a virtual rover listens there already; give this one another --control")
    _remove(path)


def _remove(path: Path) -> None:
    path.unlink(missing_ok=True)


def _answers(path: Path) -> bool:
    try:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(CONNECT_TIMEOUT_S)
            connection.connect(str(path))
    except OSError:
        return False
    return True
