"""The metrics socket: answers any HTTP request on a UNIX socket with the metrics of the daemon; it takes no commands.

    curl --unix-socket /run/regolithd/metrics.sock rover/metrics

Every user of the computer may read it. The text is made at most once a second, however many ask.
"""

from __future__ import annotations

import asyncio
import logging
import time
from contextlib import suppress
from typing import TYPE_CHECKING

from regolithd.daemon.control.socket import ControlSocketError, open_socket
from regolithd.daemon.health.prometheus import CONTENT_TYPE

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable
    from pathlib import Path

    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.drivers.master.events import NetworkEvent

NAME = "metrics.sock"
"""Its file, beside the control socket."""
MODE = 0o666
VALID_S = 1.0
REQUEST_LIMIT = 8192
REQUEST_TIMEOUT_S = 2.0
MAX_CLIENTS = 8
_log = logging.getLogger(__name__)


class MetricsSink:
    """Serves the metrics; as a sink of the service it only has a task of its own.

    Parameters
    ----------
    path
        The socket's file.
    text
        Returns the metrics in the text exposition format.
    """

    def __init__(self, path: Path, text: Callable[[], str]) -> None:
        self._path = path
        self._text = text
        self._answer = b""
        self._made_s = -VALID_S
        self._clients = 0

    def estimate(self, estimate: Estimate) -> None:
        """Do nothing with an estimate."""

    def event(self, event: NetworkEvent) -> None:
        """Do nothing with an event."""

    async def run(self) -> None:
        """Serve until cancelled. Where the socket cannot be created, log why, and serve nothing."""
        try:
            listener = open_socket(self._path, MODE)
        except ControlSocketError as error:
            _log.warning("no metrics: %s", error)
            return
        try:
            await self._serve(listener)
        finally:
            self._path.unlink(missing_ok=True)

    async def _serve(self, listener: socket.socket) -> None:
        async with asyncio.TaskGroup() as tasks:

            def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
                tasks.create_task(self._serve_client(reader, writer))

            server = await asyncio.start_unix_server(accept, sock=listener, limit=REQUEST_LIMIT)
            try:
                await asyncio.get_running_loop().create_future()
            finally:
                server.close()

    async def _serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one request, whatever it asks for, and close the connection."""
        self._clients += 1
        try:
            if self._clients <= MAX_CLIENTS:
                async with asyncio.timeout(REQUEST_TIMEOUT_S):
                    await reader.readuntil(b"\r\n\r\n")
                    writer.write(self._response())
                    await writer.drain()
        except (OSError, EOFError, asyncio.LimitOverrunError):  # OSError: also a time-out
            pass
        finally:
            self._clients -= 1
            writer.close()
            with suppress(OSError):
                await writer.wait_closed()

    def _response(self) -> bytes:
        now_s = time.monotonic()
        if now_s - self._made_s >= VALID_S:
            body = self._text().encode()
            head = f"HTTP/1.0 200 OK\r\nContent-Type: {CONTENT_TYPE}\r\nContent-Length: {len(body)}\r\n\r\n"
            self._answer, self._made_s = head.encode() + body, now_s
        return self._answer
