"""What a bus does when the system call or the adapter fails; the test makes the failures."""

from __future__ import annotations

import asyncio
import ctypes
import errno
from typing import TYPE_CHECKING, Any

import can
import pytest
from rig import until

from regolithd.drivers.can import python_can_bus, recvmmsg
from regolithd.drivers.can.bus import BusState
from regolithd.drivers.can.counters import BusCounters
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.can.recvmmsg import BATCH, RecvmmsgBuffers
from regolithd.drivers.errors import BusDownError, BusFullError, BusOpenError

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.mark.parametrize("number", [errno.EAGAIN, errno.EINTR])
def test_nothing_to_receive_is_no_error(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A non-blocking call for at most 64 frames, with no timeout."""
    called: list[tuple[Any, ...]] = []

    def fails(*arguments: Any) -> int:
        called.append(arguments)
        ctypes.set_errno(number)
        return -1

    monkeypatch.setattr(recvmmsg, "_recvmmsg", fails)
    buffers = RecvmmsgBuffers()
    assert buffers.receive(7, BusCounters()) == []
    assert called == [(7, ctypes.addressof(buffers._headers), BATCH, 0x40, None)]
    assert BATCH == 64


def test_a_system_error_is_raised_with_its_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bus decides by it whether the link is down or gone."""

    def fails(*_arguments: Any) -> int:
        ctypes.set_errno(errno.ENETDOWN)
        return -1

    monkeypatch.setattr(recvmmsg, "_recvmmsg", fails)
    with pytest.raises(OSError, match="Network is down") as error:
        RecvmmsgBuffers().receive(7, BusCounters())
    assert error.value.errno == errno.ENETDOWN


def test_each_call_starts_with_fresh_headers(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel shortens the control length in them; the next call needs the full one."""
    lengths: list[int] = []
    buffers = RecvmmsgBuffers()

    def shortens(*_arguments: Any) -> int:
        lengths.append(buffers._headers[0].header.control_length)
        buffers._headers[0].header.control_length = 8
        return 0

    monkeypatch.setattr(recvmmsg, "_recvmmsg", shortens)
    for _ in range(2):
        assert buffers.receive(7, BusCounters()) == []
    assert lengths == [64, 64]


class Adapter:
    """A python-can bus that fails as the test wants."""

    def __init__(self) -> None:
        self.send_error: Exception | None = None
        self.receive_error: Exception | None = None
        self.waiting: list[can.Message] = []
        self.sent: list[can.Message] = []
        self.timeouts: list[float] = []
        self.closed = 0

    def send(self, message: can.Message, timeout: float) -> None:
        """Keep a message, or fail."""
        self.timeouts.append(timeout)
        if self.send_error:
            raise self.send_error
        self.sent.append(message)

    def recv(self, timeout: float) -> can.Message | None:
        """Return the next message, or None after the timeout."""
        if self.receive_error:
            raise self.receive_error
        if not self.waiting and timeout:
            python_can_bus.time.sleep(0.001)
        return self.waiting.pop(0) if self.waiting else None

    def shutdown(self) -> None:
        """Count."""
        self.closed += 1


@pytest.fixture
def adapters(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return what python-can opens in turn: an adapter, or an error; the last one is opened from then on."""
    prepared: list[Any] = [Adapter()]
    given: list[dict[str, Any]] = []

    def opened(**options: Any) -> Adapter:
        given.append(options)
        found = prepared.pop(0) if len(prepared) > 1 else prepared[0]
        if isinstance(found, Exception):
            raise found
        return found

    monkeypatch.setattr(python_can_bus.can, "Bus", opened)
    monkeypatch.setattr(python_can_bus, "_REOPEN_S", 0.01)
    prepared_and_given: list[Any] = [prepared, given]
    return prepared_and_given


async def test_options_reach_python_can(adapters: list[Any]) -> None:
    """The bit rate only where it is given; own frames are received."""
    prepared, given = adapters
    async with open_bus("pcan", "p1", bitrate=250_000) as bus:
        await bus.send(Frame(0, 0x123, b"ab", extended=True))
    async with open_bus("pcan", "p1"):
        pass
    assert given == [
        {"channel": "p1", "interface": "pcan", "receive_own_messages": True, "bitrate": 250_000},
        {"channel": "p1", "interface": "pcan", "receive_own_messages": True},
    ]
    (message,) = prepared[0].sent
    assert (message.arbitration_id, bytes(message.data)) == (0x123, b"ab")
    assert (message.is_extended_id, message.is_remote_frame) == (True, False)
    assert prepared[0].timeouts == [0.1]
    assert prepared[0].closed == 2


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (can.CanTimeoutError("full"), BusFullError),
        (can.CanOperationError("unplugged"), BusDownError),
        (OSError("gone"), BusDownError),
    ],
)
async def test_a_frame_that_is_not_sent_is_counted_and_raised(
    adapters: list[Any], error: Exception, expected: type[Exception]
) -> None:
    """A full queue and a missing adapter are told apart."""
    prepared, _ = adapters
    async with open_bus("pcan", "p1") as bus:
        prepared[0].send_error = error
        with pytest.raises(expected, match=f"^pcan p1: {error}"):
            await bus.send(Frame(0, 0x080, b""))
        assert (bus.counters.transmit_failures, bus.counters.sent) == (1, 0)
        prepared[0].send_error = None
        await bus.send(Frame(0, 0x080, b""))
        assert (bus.counters.transmit_failures, bus.counters.sent) == (1, 1)


async def test_an_unplugged_adapter_is_opened_again(adapters: list[Any]) -> None:
    """The bus is down meanwhile, however often that fails, and active afterwards."""
    prepared, given = adapters
    first, second = prepared[0], Adapter()
    prepared += [OSError("still gone"), can.CanInitializationError("still gone"), second]
    states: list[BusState] = []
    async with open_bus("pcan", "p1") as bus:
        change: Callable[[BusState], None] = bus.change_state

        def keep(state: BusState) -> None:
            states.append(state)
            change(state)

        bus.change_state = keep  # type: ignore[method-assign]
        first.receive_error = can.CanOperationError("unplugged")
        await until(lambda: bus.state is BusState.ACTIVE and len(states) == 2, "active again")
        assert states == [BusState.DOWN, BusState.ACTIVE]
        assert len(given) == 4
        assert first.closed == 1
        second.waiting += [can.Message(1.0, 0x181, is_extended_id=False, data=b"a")] * 3
        received: list[Frame] = []
        async with asyncio.timeout(20):
            while len(received) < 3:
                received += await bus.receive()
        assert [frame.data for frame in received] == [b"a"] * 3
        assert bus.counters.link_down == 1


async def test_error_frames_are_counted(adapters: list[Any]) -> None:
    """python-can does not report their class."""
    prepared, _ = adapters
    async with open_bus("pcan", "p1") as bus:
        prepared[0].waiting += [can.Message(1.0, 0, is_error_frame=True), can.Message(1.0, 0x80, is_extended_id=False)]
        async with asyncio.timeout(20):
            while bus.counters.received < 2:
                await bus.receive()
        assert bus.counters.errors == {"adapter": 1}


async def test_an_adapter_that_is_not_there_is_named(adapters: list[Any]) -> None:
    """With the interfaces that there are."""
    prepared, _ = adapters
    for error in (can.CanInitializationError("none"), OSError("none"), ValueError("none"), TypeError("none")):
        prepared[:] = [error]
        with pytest.raises(BusOpenError, match=r"cannot open channel 'p1' of interface 'pcan': none.*These interfaces"):
            async with open_bus("pcan", "p1"):
                pass
