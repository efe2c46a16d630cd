"""What SocketCanBus does with its socket: options, frames, a full queue, a lost link; the test is the kernel."""

from __future__ import annotations

import asyncio
import errno
import os
import socket
import sys
from typing import TYPE_CHECKING, Any

import pytest
from rig import until

from regolithd.drivers.can import socketcan
from regolithd.drivers.can.bus import BusState
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.can.recvmmsg import BATCH
from regolithd.drivers.can.socketcan import SocketCanBus
from regolithd.drivers.errors import BusDownError, BusFullError, BusOpenError

if TYPE_CHECKING:
    from collections.abc import Iterator


class Kernel:
    """The other end of each socket that the bus opens, oldest first; `errors` are raised by the next openings."""

    def __init__(self) -> None:
        self.ours: list[socket.socket] = []
        self.theirs: list[socket.socket] = []
        self.errors: list[Exception] = []

    def open(self, channel: str) -> socket.socket:
        """Return a socket of datagrams, which carries one frame in each as a CAN socket does."""
        assert channel == "can7"
        if self.errors:
            raise self.errors.pop(0)
        mine, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        for end in (mine, other):
            end.setblocking(False)
        self.ours.append(mine)
        self.theirs.append(other)
        return mine


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Iterator[Kernel]:
    """A kernel whose adapter is there."""
    made = Kernel()
    monkeypatch.setattr(socketcan, "_open_socket", made.open)
    monkeypatch.setattr(socketcan, "_REOPEN_S", 0.01)
    yield made
    for each in (*made.ours, *made.theirs):
        each.close()


def struct_can_frame(can_id: int, data: bytes) -> bytes:
    """Return linux/can.h's struct can_frame: identifier and flags, length, three bytes of padding, data."""
    return can_id.to_bytes(4, sys.byteorder) + bytes([len(data), 0, 0, 0]) + data.ljust(8, b"\0")


class Failing:
    """A socket that cannot send: each error in turn, then it can."""

    def __init__(self, whole: socket.socket, numbers: list[int]) -> None:
        self._whole, self._numbers, self.calls = whole, numbers, 0

    def send(self, data: bytes) -> int:
        """Fail, or send."""
        self.calls += 1
        if self._numbers:
            number = self._numbers.pop(0)
            raise OSError(number, os.strerror(number))
        return self._whole.send(data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._whole, name)


def failing(bus: SocketCanBus, *numbers: int) -> Failing:
    """Let the bus's socket fail to send."""
    made = Failing(bus._socket, list(numbers))
    bus._socket = made  # type: ignore[assignment]
    return made


@pytest.mark.parametrize(
    ("frame", "can_id"),
    [
        (Frame(0, 0x120, b"ab"), 0x120),
        (Frame(0, 0x122, b"12345678", extended=True), 0x80000122),
        (Frame(0, 0x700, b"", remote=True), 0x40000700),
    ],
)
async def test_a_frame_is_sent_as_the_kernel_wants_it(kernel: Kernel, frame: Frame, can_id: int) -> None:
    """Sixteen bytes, flags in the identifier's upper bits."""
    async with open_bus("socketcan", "can7") as bus:
        await bus.send(frame)
        assert kernel.theirs[0].recv(64) == struct_can_frame(can_id, frame.data)
        assert (bus.counters.sent, bus.counters.transmit_retries, bus.counters.transmit_failures) == (1, 0, 0)
        assert (bus.interface, bus.channel) == ("socketcan", "can7")


async def test_frames_that_wait_come_in_order(kernel: Kernel) -> None:
    """With data of their own length; what is no CAN frame is counted."""
    async with open_bus("socketcan", "can7") as bus:
        for each in (struct_can_frame(0x181, b"abc"), b"short", struct_can_frame(0x80000005, b"")):
            kernel.theirs[0].send(each)
        frames = await bus.receive()
        assert [(frame.can_id, frame.data, frame.extended) for frame in frames] == [
            (0x181, b"abc", False),
            (0x5, b"", True),
        ]
        assert (bus.counters.received, bus.counters.malformed, bus.counters.batches) == (2, 1, 1)


@pytest.mark.usefixtures("kernel")
async def test_a_full_queue_is_tried_again_with_growing_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    """From half a millisecond, twice as long each time, until a tenth of a second has passed."""
    pauses: list[float] = []

    async def slept(seconds: float) -> None:
        pauses.append(seconds)

    async with open_bus("socketcan", "can7") as bus:
        assert isinstance(bus, SocketCanBus)
        monkeypatch.setattr(socketcan.asyncio, "sleep", slept)
        failing(bus, errno.ENOBUFS, errno.EAGAIN)
        await bus.send(Frame(0, 0x80, b""))
        assert pauses == [0.0005, 0.001]
        assert (bus.counters.sent, bus.counters.transmit_retries, bus.counters.transmit_failures) == (1, 2, 0)
        pauses.clear()
        failing(bus, *[errno.ENOBUFS] * 99)
        with pytest.raises(BusFullError, match=r"^can7: the transmit queue stayed full for 0\.1 s"):
            await bus.send(Frame(0, 0x80, b""))
        assert pauses == [0.0005 * 2**k for k in range(8)]
        assert sum(pauses[:-1]) < 0.1 <= sum(pauses)
        assert (bus.counters.sent, bus.counters.transmit_retries, bus.counters.transmit_failures) == (1, 10, 1)
        assert bus.state is BusState.ACTIVE


@pytest.mark.parametrize(
    ("number", "state"),
    [
        (errno.ENETDOWN, BusState.DOWN),
        (errno.ENETUNREACH, BusState.DOWN),
        (errno.ENODEV, BusState.DOWN),
        (errno.ENXIO, BusState.DOWN),
        (errno.EINVAL, BusState.ACTIVE),
    ],
)
async def test_a_frame_that_cannot_be_sent_is_raised_at_once(kernel: Kernel, number: int, state: BusState) -> None:
    """A link that is down is no full queue; an error of the call says nothing about the link."""
    async with open_bus("socketcan", "can7") as bus:
        assert isinstance(bus, SocketCanBus)
        tried = failing(bus, number)
        with pytest.raises(BusDownError, match=f"^can7: cannot send: {os.strerror(number)}"):
            await bus.send(Frame(0, 0x80, b""))
        assert (tried.calls, bus.counters.transmit_failures, bus.counters.sent) == (1, 1, 0)
        assert bus.state is state
        assert len(kernel.ours) == 1


@pytest.mark.parametrize("number", [errno.ENODEV, errno.ENXIO])
async def test_an_adapter_that_was_unplugged_is_opened_again(kernel: Kernel, number: int) -> None:
    """However often that fails; the bus is active again with the first frame of the new socket."""
    async with open_bus("socketcan", "can7") as bus:
        assert isinstance(bus, SocketCanBus)
        kernel.errors += [BusOpenError("can7 is not there", remedy="")] * 2
        bus._lost(OSError(number, "gone"))
        bus._lost(OSError(number, "gone"))
        assert await bus.receive() == []
        assert bus.state is BusState.DOWN
        await until(lambda: len(kernel.ours) == 2, "another socket")
        await asyncio.sleep(0.05)
        assert len(kernel.ours) == 2
        assert kernel.errors == []
        assert kernel.ours[0].fileno() == -1
        kernel.theirs[1].send(struct_can_frame(0x705, b"\x05"))
        assert [frame.can_id for frame in await bus.receive()] == [0x705]
        assert bus.state is BusState.ACTIVE
        assert bus.counters.link_down == 1
        bus._lost(OSError(number, "gone again"))
        await until(lambda: len(kernel.ours) == 3, "a third socket")


async def test_a_link_that_is_down_keeps_its_socket(kernel: Kernel) -> None:
    """It says so when it is read, and receives again when the link is up."""

    def down(*_: Any) -> list[Frame]:
        raise OSError(errno.ENETDOWN, "Network is down")

    async with open_bus("socketcan", "can7") as bus:
        assert isinstance(bus, SocketCanBus)
        reading, bus._batch.receive = bus._batch.receive, down  # type: ignore[method-assign]
        bus._drain()
        assert bus.state is BusState.DOWN
        assert await bus.receive() == []
        bus._batch.receive = reading  # type: ignore[method-assign]
        kernel.theirs[0].send(struct_can_frame(0x80, b""))
        assert len(await bus.receive()) == 1
        assert bus.state is BusState.ACTIVE
        assert len(kernel.ours) == 1


async def test_a_closed_bus_opens_nothing_any_more(kernel: Kernel) -> None:
    """Also where it was about to open the adapter again."""
    async with open_bus("socketcan", "can7") as bus:
        assert isinstance(bus, SocketCanBus)
        bus._lost(OSError(errno.ENODEV, "gone"))
    await asyncio.sleep(0.05)
    assert len(kernel.ours) == 1
    assert kernel.ours[0].fileno() == -1


async def test_an_adapter_that_is_lost_while_the_bus_is_closed_is_not_opened_again(kernel: Kernel) -> None:
    """The read before closing may be the first to be told that it is gone."""

    def gone(*_: object) -> list[Frame]:
        raise OSError(errno.ENODEV, "gone")

    async with open_bus("socketcan", "can7") as bus:
        assert isinstance(bus, SocketCanBus)
        bus._batch.receive = gone  # type: ignore[method-assign]
    await asyncio.sleep(0.05)
    assert bus.state is BusState.DOWN
    assert len(kernel.ours) == 1


async def test_a_controller_that_is_off_is_on_again_when_others_are_heard(kernel: Kernel) -> None:
    """An echo of our own says nothing then, of a link that was down it does; error frames are counted by class."""
    bus_off, own = Frame(0, 0x40, bytes(8), error=True), Frame(0, 0x80, b"", sent=True)
    async with open_bus("socketcan", "can7") as bus:
        assert isinstance(bus, SocketCanBus)
        states = []
        for frame in (bus_off, own, Frame(0, 0x181, b"")):
            bus._take([frame])
            states.append(bus.state)
        assert states == [BusState.OFF, BusState.OFF, BusState.ACTIVE]
        bus._take([Frame(0, 0x04, b"\0\x10" + bytes(6), error=True), Frame(0, 0x04, bytes(8), error=True)])
        assert bus.state is BusState.PASSIVE
        bus._take([own, Frame(0, 0x181, b"")])
        assert bus.state is BusState.PASSIVE
        bus.change_state(BusState.DOWN)
        bus._take([own])
        assert bus.state is BusState.ACTIVE
        assert bus.counters.errors == {"bus-off": 1, "controller": 2}
        assert (bus.counters.bus_off, bus.counters.link_down) == (1, 1)
        assert kernel.errors == []


@pytest.mark.parametrize(("sizes", "calls"), [([BATCH] * 20, 8), ([BATCH, 3, BATCH], 2), ([0], 1)])
async def test_a_flood_leaves_time_for_other_tasks(kernel: Kernel, sizes: list[int], calls: int) -> None:
    """At most eight batches are read at once; a batch that is not full is the last."""
    async with open_bus("socketcan", "can7") as bus:
        assert isinstance(bus, SocketCanBus)
        read: list[int] = []

        def receive(descriptor: int, counters: object) -> list[Frame]:
            assert (descriptor, counters) == (kernel.ours[0].fileno(), bus.counters)
            read.append(sizes[len(read)] if len(read) < len(sizes) else 0)
            return [Frame(0, 0x80, b"")] * read[-1]

        bus._batch.receive = receive  # type: ignore[method-assign]
        bus._drain()
        assert read == sizes[:calls]
        assert bus.counters.batches == sum(size > 0 for size in read)
        assert bus.counters.received == sum(read)


async def test_frames_that_wait_are_read_before_the_bus_is_closed(kernel: Kernel) -> None:
    """As the echoes of the last frames sent, for which the event loop had no turn."""
    async with open_bus("socketcan", "can7") as bus:
        kernel.theirs[0].send(struct_can_frame(0x80, b""))
    assert bus.counters.received == 1


async def test_a_paused_bus_leaves_frames_with_the_kernel(kernel: Kernel) -> None:
    """Until it reads again."""
    async with open_bus("socketcan", "can7") as bus:
        bus.pause_reading()
        kernel.theirs[0].send(struct_can_frame(0x80, b""))
        await asyncio.sleep(0.02)
        assert bus.counters.received == 0
        bus.resume_reading()
        assert len(await bus.receive()) == 1


class Options:
    """A raw CAN socket that notes what is asked of it, and refuses what the test wants."""

    def __init__(self, *kind: int) -> None:
        self.kind, self.options, self.bound, self.closed = kind, [], None, False  # type: ignore[var-annotated]
        self.refused: tuple[object, ...] = ()

    def setsockopt(self, level: int, option: int, value: object) -> None:
        """Note an option, or refuse it."""
        if option in self.refused:
            raise PermissionError(errno.EPERM, "Operation not permitted")
        self.options.append((level, option, value))

    def bind(self, address: tuple[str]) -> None:
        """Note the channel, or refuse it."""
        if "bind" in self.refused:
            raise OSError(errno.ENODEV, "No such device")
        self.bound = address

    def close(self) -> None:
        """Note it."""
        self.closed = True


@pytest.mark.parametrize(("refused", "buffer"), [((), 33), ((33,), socket.SO_RCVBUF)])
def test_the_socket_has_times_drops_own_frames_and_errors(
    refused: tuple[int, ...], buffer: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a receive buffer of 4 MiB: beyond the usual limit where that is permitted."""
    made = Options()
    made.refused = refused
    kinds: list[tuple[int, ...]] = []

    def opened(*kind: int) -> Options:
        kinds.append(kind)
        return made

    monkeypatch.setattr(socketcan.socket, "socket", opened)
    assert socketcan._open_socket("can7") is made  # type: ignore[comparison-overlap]
    assert kinds == [(socket.AF_CAN, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.CAN_RAW)]
    assert made.options == [
        (socket.SOL_SOCKET, 35, 1),  # SO_TIMESTAMPNS
        (socket.SOL_SOCKET, 40, 1),  # SO_RXQ_OVFL
        (socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, 1),
        (socket.SOL_CAN_RAW, 2, (2**29 - 1).to_bytes(4, sys.byteorder)),  # CAN_RAW_ERR_FILTER
        (socket.SOL_SOCKET, buffer, 4 * 1024 * 1024),
    ]
    assert (made.bound, made.closed) == (("can7",), False)


def test_a_link_that_is_not_there_is_named_and_its_socket_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the commands that make it; a link of another type and a kernel without SocketCAN are told apart."""
    made = Options()
    made.refused = ("bind",)
    monkeypatch.setattr(socketcan.socket, "socket", lambda *_: made)
    with pytest.raises(BusOpenError, match=r"^cannot open can7: No such device.*ip link add dev can7 type vcan"):
        socketcan._open_socket("can7")
    assert made.closed
    with pytest.raises(
        BusOpenError, match=r"^cannot open lo: it is no CAN link. Name one that `ip link show type can`"
    ):
        socketcan._open_socket("lo")

    def none(*_: int) -> None:
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr(socketcan.socket, "socket", none)
    with pytest.raises(BusOpenError, match=r"^this kernel has no SocketCAN: Address family not supported.*modprobe"):
        socketcan._open_socket("can7")
