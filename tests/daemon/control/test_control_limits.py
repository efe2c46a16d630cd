"""However many clients connect, and whatever they leave unfinished, the control socket obeys `stop`."""

import asyncio
import socket
from contextlib import suppress
from pathlib import Path

import pytest
from control_rig import LONG, Client, Rover, serving

from regolithd.daemon.control.protocol import Accepted
from regolithd.daemon.control.server import MAX_CLIENTS


async def test_stop_gets_through_a_thousand_half_sent_lines(tmp_path: Path) -> None:
    """They replace each other, but neither the client that commanded the traverse nor one with a request."""
    rover = Rover()
    async with serving(tmp_path, rover) as (sink, path):
        owner = await Client.to(path)
        assert isinstance(await owner.ask(LONG), Accepted)
        half_sent = [await connected(path) for _ in range(1000)]
        for each in half_sent:
            with suppress(OSError):
                each.send(b'{"command": ')
        stop = await Client.to(path)
        assert (await stop.ask({"command": "stop", "quick": True})).text == "The traverse is being stopped."
        assert (await owner.hear_end()).ending == "quick-stopped"
        assert "quick stop" in rover.told
        assert len(sink._clients) <= MAX_CLIENTS
        for each in half_sent:
            each.close()


async def connected(path: Path) -> socket.socket:
    """Return a connected socket."""
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.setblocking(False)
    while True:
        try:
            client.connect(str(path))
        except BlockingIOError:  # the kernel's queue is full
            await asyncio.sleep(0.001)
        else:
            return client


async def test_a_line_that_is_not_finished_in_time_ends_its_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sending it byte by byte does not prolong the time; a client that sends nothing stays connected."""
    monkeypatch.setattr("regolithd.daemon.control.server.LINE_TIMEOUT_S", 0.2)
    async with serving(tmp_path, Rover()) as (_, path):
        silent = await Client.to(path)
        slow = await Client.to(path)
        with suppress(ConnectionError):
            for _ in range(12):
                slow.writer.write(b" ")
                await asyncio.sleep(0.05)
            assert await slow.reader.read() == b""
        assert slow.reader.at_eof() or slow.writer.is_closing()
        assert (await silent.ask({"command": "status"})).rover == "kapvik"
