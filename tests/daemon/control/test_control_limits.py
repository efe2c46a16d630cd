"""However many clients connect, and whatever they leave unfinished, the control socket obeys `stop`."""

import asyncio
import socket
import time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest
from control_rig import GROUP, LONG, Client, Rover, serving
from subscriber import until

from regolithd.daemon.config.configuration import Configuration, Control
from regolithd.daemon.control import server
from regolithd.daemon.control.client import control_connection
from regolithd.daemon.control.protocol import Accepted
from regolithd.daemon.control.server import MAX_CLIENTS, ControlSink
from regolithd.daemon.control.socket import ControlSocketError
from regolithd.drivers.master.events import MotionStopped


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


def pauses_of(sink: ControlSink, beats: list[int], monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, float]]:
    """Let the server sleep no longer than a turn of the loop; return beats so far and seconds of each sleep."""
    pauses: list[tuple[int, float]] = []

    async def slept(seconds: float) -> None:
        pauses.append((len(beats), seconds))
        await asyncio.sleep(0)

    sink._beat = lambda: beats.append(0)
    monkeypatch.setattr(server, "asyncio", SimpleNamespace(**vars(asyncio) | {"sleep": slept}))
    return pauses


async def test_the_task_beats_twice_a_second_while_it_serves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The supervisor expects a beat each second."""
    control = Control(socket=tmp_path / "control.sock", group=GROUP)
    sink, beats = ControlSink(Configuration(control=control), lambda: None), list[int]()
    pauses = pauses_of(sink, beats, monkeypatch)
    task = asyncio.create_task(sink.run())
    await until(lambda: len(pauses) >= 5)
    task.cancel()
    assert pauses[:5] == [(number, 0.5) for number in range(1, 6)]


async def test_a_socket_that_cannot_be_made_is_tried_every_five_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With beats meanwhile, and the reason in the status."""
    control = Control(socket=tmp_path / "absent" / "folder" / "control.sock", group="no-such-group")
    sink, beats = ControlSink(Configuration(control=control), lambda: None), list[int]()
    pauses, tried = pauses_of(sink, beats, monkeypatch), list[int]()

    def refused(*_: object) -> None:
        tried.append(len(pauses))
        raise ControlSocketError("no such group")

    monkeypatch.setattr(server, "open_control_socket", refused)
    task = asyncio.create_task(sink.run())
    await until(lambda: len(tried) >= 3)
    task.cancel()
    assert tried[:3] == [0, 10, 20]
    assert pauses[:10] == [(number, 0.5) for number in range(1, 11)]
    assert sink.problem == "no such group"


async def test_a_client_waits_while_the_queue_of_connections_is_full(tmp_path: Path) -> None:
    """Where too many wait to be accepted, a client tries again and is connected, instead of failing at once."""
    path = tmp_path / "control.sock"
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(path))
    listener.listen(1)
    waiting = []
    while True:
        waiting.append(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK))
        try:
            waiting[-1].connect(str(path))
        except BlockingIOError:
            break

    def accept_later() -> None:
        time.sleep(0.2)
        for _ in waiting:  # of these the last is not connected; the client's is
            listener.accept()[0].close()

    accepting = asyncio.create_task(asyncio.to_thread(accept_later))
    async with control_connection(path):
        await accepting
    for each in (*waiting, listener):
        each.close()


def test_only_a_stop_of_the_motion_ends_a_traverse() -> None:
    """Another event does not, and a stop without a traverse is nothing."""
    told: list[tuple[str, bool]] = []
    sink = ControlSink(Configuration(), lambda: None)
    sink.event(MotionStopped(0, 3, "node 3 is silent"))
    sink._traverse = SimpleNamespace(stop=lambda text, *, quick: told.append((text, quick)))  # type: ignore[assignment]
    sink.event(SimpleNamespace(text="something else"))  # type: ignore[arg-type]
    assert told == []
    sink.event(MotionStopped(0, 3, "node 3 is silent"))
    assert told == [("node 3 is silent", True)]
