"""One contract for every kind of bus: python-can's virtual bus, and SocketCAN."""

from __future__ import annotations

import asyncio
import time

import can
import pytest
from rig import until

from regolithd.drivers.can.bus import Bus, BusState
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.errors import BusDownError, BusOpenError

BOTH = pytest.mark.parametrize(
    ("interface", "channel"),
    [("virtual", "contract"), pytest.param("socketcan", "vcan1", marks=pytest.mark.vcan)],
    ids=["virtual", "socketcan"],
)
FRAMES = [
    Frame(0, 0x080, b""),
    Frame(0, 0x181, bytes(range(8))),
    Frame(0, 0x7FF, b"\xff"),
    Frame(0, 0x1FFFFFFF, b"extended", extended=True),
    Frame(0, 0x123, b"abc"),
]


async def take(bus: Bus, count: int) -> list[Frame]:
    """Return the next frames."""
    frames: list[Frame] = []
    async with asyncio.timeout(20):
        while len(frames) < count:
            frames += await bus.receive()
    return frames


@BOTH
async def test_frames_arrive_in_order_and_echoes_are_marked(interface: str, channel: str) -> None:
    """Received frames and echoes equal the sent ones, apart from time and `sent`, and both buses count the same."""
    async with open_bus(interface, channel) as one, open_bus(interface, channel) as two:
        before_ns = time.time_ns()
        for frame in FRAMES:
            await one.send(frame)
        echoes, received = await take(one, len(FRAMES)), await take(two, len(FRAMES))
        assert [frame._replace(time_ns=0) for frame in received] == FRAMES
        assert [frame._replace(time_ns=0) for frame in echoes] == [frame._replace(sent=True) for frame in FRAMES]
        assert all(before_ns - 1000 <= frame.time_ns <= time.time_ns() + 1000 for frame in received)
        assert (one.counters.sent, one.counters.echoed, one.counters.received) == (5, 5, 0)
        assert (two.counters.sent, two.counters.echoed, two.counters.received) == (0, 0, 5)
        assert one.state is two.state is BusState.ACTIVE


@BOTH
async def test_cancelling_a_wait_loses_nothing(interface: str, channel: str) -> None:
    """A reader that is cancelled repeatedly receives every frame in the end."""
    async with open_bus(interface, channel) as one, open_bus(interface, channel) as two:
        got: list[Frame] = []
        for number in range(200):
            await one.send(Frame(0, 0x181, number.to_bytes(2, "big")))
            try:
                async with asyncio.timeout(0.0005 * (number % 3)):
                    got += await two.receive()
            except TimeoutError:
                pass
        got += await take(two, 200 - len(got))
        assert [int.from_bytes(frame.data, "big") for frame in got] == list(range(200))


@BOTH
async def test_a_slow_reader_pauses_the_reading_and_loses_nothing(
    interface: str, channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While the consumer is too slow, frames wait and none is lost."""
    monkeypatch.setattr("regolithd.drivers.can.bus._MOST_PENDING", 10)
    async with open_bus(interface, channel) as one, open_bus(interface, channel) as two:
        for number in range(100):
            await one.send(Frame(0, 0x181, number.to_bytes(2, "big")))
            await asyncio.sleep(0)
        await until(lambda: two._paused, "a pause")
        got = await take(two, 100)
        assert [int.from_bytes(frame.data, "big") for frame in got] == list(range(100))


async def test_an_unknown_interface_is_refused() -> None:
    """The error message lists the interfaces that exist."""
    with pytest.raises(BusOpenError, match=r"'telepathy'.*socketcan.*virtual"):
        async with open_bus("telepathy", "x"):
            pass


async def test_a_failed_adapter_is_reported_as_down_and_reopened(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a read error the state is down, and after the adapter is opened again it is active and frames arrive."""
    monkeypatch.setattr("regolithd.drivers.can.python_can_bus._REOPEN_S", 0.05)
    async with open_bus("virtual", "flaky") as bus, open_bus("virtual", "flaky") as other:
        bus._bus.shutdown()  # as if it were unplugged
        async with asyncio.timeout(20):
            while bus.state is not BusState.DOWN:
                await bus.receive()
            while bus.state is not BusState.ACTIVE:
                await bus.receive()
        await other.send(FRAMES[1])
        assert (await take(bus, 1))[0].data == FRAMES[1].data
        assert bus.counters.link_down == 1


async def test_a_send_error_of_python_can_becomes_a_bus_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """A python-can exception in `send` becomes a `BusDownError` with the exception as its cause."""
    async with open_bus("virtual", "mute") as bus:

        def refuse(*_: object, **__: object) -> None:
            raise can.CanOperationError("no wire")

        monkeypatch.setattr(bus._bus, "send", refuse)
        with pytest.raises(BusDownError, match="virtual mute: no wire") as told:
            await bus.send(FRAMES[0])
        assert isinstance(told.value.__cause__, can.CanError)
        assert bus.counters.transmit_failures == 1
