"""The other end of the control socket: what the commands speak to the daemon with."""

from __future__ import annotations

import asyncio
import os
import sys
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
    """The daemon cannot be spoken to; the message says why, and the cure. `exit_status` is of sysexits.h."""

    def __init__(self, message: str, exit_status: int) -> None:
        super().__init__(message)
        self.exit_status = exit_status


EX_UNAVAILABLE = 69
EX_NOPERM = 77
INSTALLED = Path("/etc/regolithd/rover.toml")


def control_socket_path(config: Path | None) -> Path:
    """Return where the daemon of this configuration answers; of the installed one where none is given.

    Raises
    ------
    ConfigurationError
        The configuration cannot be used.
    """
    path = config or (INSTALLED if os.access(INSTALLED, os.R_OK) else None)
    return (Configuration() if path is None else read_configuration(path)).control.socket


class Conversation:
    """A connection to the daemon: ask, and read what it says."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    def ask(self, request: _Line) -> None:
        """Send a request."""
        self._writer.write(request.line())

    async def reply(self) -> Accepted | Progress | Ended | Done | Refused | Status:
        """Return the next thing that the daemon says."""
        try:
            line = await self._reader.readline()
        except ConnectionError:
            line = b""
        if not line:
            raise ControlError("The daemon closed the connection: it was stopped, or it died.", EX_UNAVAILABLE)
        return REPLY.validate_json(line)


@asynccontextmanager
async def conversation(path: Path) -> AsyncIterator[Conversation]:
    """Open the control socket."""
    try:
        reader, writer = await asyncio.open_unix_connection(path, limit=LINE_LIMIT)
    except (FileNotFoundError, ConnectionRefusedError) as error:
        cure = "Start it (`systemctl start regolithd`), or give its configuration with --config."
        raise ControlError(f"No daemon is running: nobody answers at {path}. {cure}", EX_UNAVAILABLE) from error
    except PermissionError as error:
        cure = (
            "Only members of the control group may command the rover: `sudo usermod -aG regolithd $USER`, log in anew."
        )
        raise ControlError(f"No permission to open {path}. {cure}", EX_NOPERM) from error
    except OSError as error:
        raise ControlError(f"{path}: {error.strerror or error}.", EX_UNAVAILABLE) from error
    try:
        yield Conversation(reader, writer)
    finally:
        writer.close()


def converse(config: Path | None, talk: Callable[[Path], Coroutine[None, None, int]]) -> int:
    """Run a command's talk with the daemon and return its exit status; say what is wrong where it cannot be held."""
    try:
        return asyncio.run(talk(control_socket_path(config)))
    except ConfigurationError as error:
        print(error, file=sys.stderr)  # noqa: T201  # a command speaks to a person
        return EXIT_STATUS
    except ControlError as error:
        print(error, file=sys.stderr)  # noqa: T201  # likewise
        return error.exit_status
