"""Client of the control socket, for the commands `traverse`, `stop` and `status`."""

from __future__ import annotations

import asyncio
import os
import socket
import sys
import time
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.config.reader import EXIT_STATUS, ConfigurationError, read_configuration
from regolithd.daemon.control.protocol import LINE_LIMIT, REPLY

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Coroutine

    from regolithd.daemon.control.protocol import Accepted, Done, Ended, Progress, Refused, Status, _Line


class ControlError(Exception):
    """The daemon cannot be reached; the message says why, and what to do. `exit_status` is one of sysexits.h."""

    def __init__(self, message: str, exit_status: int) -> None:
        super().__init__(message)
        self.exit_status = exit_status


EX_UNAVAILABLE = 69
EX_NOPERM = 77
CONNECT_TIMEOUT_S = 5.0
"""Time for a connection while others wait for theirs; the daemon accepts sixteen at a time."""
CONNECT_RETRY_S = 0.02
INSTALLED = Path("/etc/regolithd/rover.toml")


def control_socket_path(config: Path | None) -> Path:
    """Return the control socket's path from a configuration file, by default the installed one.

    Raises
    ------
    ConfigurationError
        The configuration cannot be used.
    """
    path = config or (INSTALLED if os.access(INSTALLED, os.R_OK) else None)
    return (Configuration() if path is None else read_configuration(path)).control.socket


class ControlConnection:
    """A connection to the daemon: send requests, read replies."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    def send(self, request: _Line) -> None:
        """Send a request."""
        self._writer.write(request.line())

    async def reply(self) -> Accepted | Progress | Ended | Done | Refused | Status:
        """Return the next reply of the daemon."""
        try:
            line = await self._reader.readline()
        except ConnectionError:
            line = b""
        if not line:
            raise ControlError("The daemon closed the connection: it was stopped, or it failed.", EX_UNAVAILABLE)
        return REPLY.validate_json(line)


async def _connected(path: Path) -> socket.socket:
    """Return a socket that is connected; while too many others wait to be accepted, try again."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
    deadline = time.monotonic() + CONNECT_TIMEOUT_S
    while True:
        try:
            connection.connect(str(path))
        except BlockingIOError:  # EAGAIN, connect(2): asyncio would take it for a connection under way
            if time.monotonic() > deadline:
                connection.close()
                raise
            await asyncio.sleep(CONNECT_RETRY_S)
        except OSError:
            connection.close()
            raise
        else:
            return connection


@asynccontextmanager
async def control_connection(path: Path) -> AsyncIterator[ControlConnection]:
    """Open the control socket."""
    try:
        reader, writer = await asyncio.open_unix_connection(sock=await _connected(path), limit=LINE_LIMIT)
    except (FileNotFoundError, ConnectionRefusedError) as error:
        remedy = "Start it (`systemctl start regolithd`), or give its configuration with --config."
        raise ControlError(f"No daemon is running: no answer at {path}. {remedy}", EX_UNAVAILABLE) from error
    except PermissionError as error:
        remedy = (
            "Only the control group's members may command the rover: `sudo usermod -aG regolithd $USER`; log in again."
        )
        raise ControlError(f"No permission to open {path}. {remedy}", EX_NOPERM) from error
    except OSError as error:
        raise ControlError(f"{path}: {error.strerror or error}.", EX_UNAVAILABLE) from error
    try:
        yield ControlConnection(reader, writer)
    finally:
        writer.close()


def run_client(config: Path | None, session: Callable[[Path], Coroutine[None, None, int]]) -> int:
    """Run a command's session with the daemon and return its exit status; print the error if there is no connection."""
    try:
        return asyncio.run(session(control_socket_path(config)))
    except ConfigurationError as error:
        print(error, file=sys.stderr)  # noqa: T201  # a command's output
        return EXIT_STATUS
    except ControlError as error:
        print(error, file=sys.stderr)  # noqa: T201  # likewise
        return error.exit_status
