"""When a socket is read: at once, or with what has gathered."""

from __future__ import annotations

import asyncio
import socket
from typing import TYPE_CHECKING

import pytest
from rig import until

from regolithd.drivers.can import moderated_reader
from regolithd.drivers.can.moderated_reader import ModeratedReader

if TYPE_CHECKING:
    from collections.abc import Iterator


class Link:
    """A pair of sockets; `reads` is how many datagrams each call of `read` found."""

    def __init__(self) -> None:
        self.near, self.far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.reads: list[int] = []
        for end in (self.near, self.far):
            end.setblocking(False)

    def read(self) -> bool:
        """Read all that waits."""
        count = 0
        try:
            while self.near.recv(16):
                count += 1
        except BlockingIOError:
            self.reads.append(count)
        return count > 0

    async def send(self, datagrams: int, reads: int) -> None:
        """Send, in turns with the event loop; wait until there have been so many reads in all."""
        for _ in range(datagrams):
            self.far.send(b"x")
            await asyncio.sleep(0)
        await until(lambda: len(self.reads) >= reads, f"{reads} reads")


@pytest.fixture
def link(monkeypatch: pytest.MonkeyPatch) -> Iterator[Link]:
    """A link, and an interval that is long beside the test's own delays."""
    monkeypatch.setattr(moderated_reader, "INTERVAL_S", 0.1)
    made = Link()
    yield made
    made.near.close()
    made.far.close()


async def test_what_comes_in_quick_succession_is_read_together(link: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first two at once, the others after the interval; then, when nothing came during one, at once again."""
    monkeypatch.setattr(moderated_reader, "INTERVAL_S", 1.0)  # longer than a busy computer keeps a process waiting
    reader = ModeratedReader(link.near, link.read)
    await link.send(1, 1)
    await link.send(1, 2)
    began = asyncio.get_running_loop().time()
    await link.send(5, 3)
    assert 0.5 < asyncio.get_running_loop().time() - began < 5.0
    await until(lambda: len(link.reads) >= 4, "the read that finds nothing")
    assert link.reads == [1, 1, 5, 0]
    began = asyncio.get_running_loop().time()
    await link.send(1, 5)
    assert asyncio.get_running_loop().time() - began < 0.9
    reader.stop()


async def test_what_comes_alone_is_read_at_once(link: Link) -> None:
    """However often: nothing is read that is not there."""
    reader = ModeratedReader(link.near, link.read)
    for number in range(1, 4):
        await link.send(1, number)
        await asyncio.sleep(0.12)
    assert link.reads == [1, 1, 1]
    reader.stop()


async def test_a_stopped_reader_reads_nothing(link: Link) -> None:
    """Also where it was about to read what has gathered; started again, it does."""
    reader = ModeratedReader(link.near, link.read)
    await link.send(1, 1)
    await link.send(1, 2)
    reader.stop()
    link.far.send(b"x")
    await asyncio.sleep(0.15)
    assert link.reads == [1, 1]
    reader.start()
    reader.start()
    await link.send(0, 3)
    assert link.reads == [1, 1, 1]
    reader.stop()
