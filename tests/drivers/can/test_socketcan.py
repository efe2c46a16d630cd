"""The SocketCAN reader against a real kernel: times, echoes, link states, errors, drops, full queues."""

from __future__ import annotations

import asyncio
import socket
import struct
import subprocess
import time
from contextlib import suppress
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
from lawicel import Adapter
from rig import Rig, settings, until

from regolithd.drivers.can.bus import Bus, BusState
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.devices.decoding.signals import Sync
from regolithd.drivers.errors import BusDownError, BusFullError, BusOpenError
from regolithd.drivers.master.events import BusStateChanged, NodeBooted, NodeLost
from regolithd.drivers.virtual.plant import Bench
from regolithd.drivers.virtual.rover import KAPVIK, VirtualRover

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.vcan
SYNC = Frame(0, 0x80, b"")


@pytest.fixture(autouse=True)
def links_come_back() -> Iterator[None]:
    """Set vcan0 up again afterwards."""
    yield
    set_link("up")


async def take(bus: Bus, count: int) -> list[Frame]:
    """Return the next frames, at least so many."""
    frames: list[Frame] = []
    async with asyncio.timeout(20):
        while len(frames) < count:
            frames += await bus.receive()
    return frames


async def until_state(bus: Bus, state: BusState) -> None:
    """Read until the bus is in a state."""
    async with asyncio.timeout(20):
        while bus.state is not state:
            await bus.receive()


def set_link(state: str) -> None:
    """Bring vcan0 up or down."""
    subprocess.run(["ip", "link", "set", "vcan0", state], check=True)


async def flood(bus: Bus) -> None:
    """Send more frames than the receive queue holds."""
    for _ in range(5000):
        await bus.send(Frame(0, 0x201, bytes(8)))


def raw_sender(channel: str = "vcan0") -> socket.socket:
    """Return a socket to send without an event loop."""
    sender = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    sender.bind((channel,))
    return sender


async def test_frames_have_kernel_times_and_echoes_are_marked() -> None:
    """Times increase and are equal for both readers, and `sent` is set for the sender only."""
    async with open_bus("socketcan", "vcan0") as ours, open_bus("socketcan", "vcan0") as theirs:
        before = time.time_ns()
        sent = [SYNC, Frame(0, 0x181, bytes(range(8))), Frame(0, 0x12345, b"abc", extended=True)]
        for frame in sent:
            await ours.send(frame)
        echoes, received = await take(ours, 3), await take(theirs, 3)
        after = time.time_ns()
        assert [frame._replace(time_ns=0, sent=False) for frame in echoes] == sent
        assert [frame.sent for frame in echoes] == [True] * 3
        assert [frame._replace(sent=True) for frame in received] == echoes
        assert before <= echoes[0].time_ns <= echoes[-1].time_ns <= after
        assert all(one.time_ns <= two.time_ns for one, two in pairwise(echoes))
        assert (ours.counters.sent, ours.counters.echoed, ours.counters.received) == (3, 3, 0)
        assert (theirs.counters.echoed, theirs.counters.received) == (0, 3)


async def test_a_burst_is_read_in_batches_without_loss() -> None:
    """Five hundred frames that arrive while the event loop is busy are received in order, many in one batch."""
    async with open_bus("socketcan", "vcan0") as bus:
        with raw_sender() as sender:
            for number in range(500):
                sender.send(struct.pack("=IB3x8s", 0x181, 8, number.to_bytes(8, "big")))
        frames = await take(bus, 500)
        assert [int.from_bytes(frame.data, "big") for frame in frames] == list(range(500))
        assert bus.counters.largest_batch == 64
        assert bus.counters.kernel_drops == 0


async def test_every_frame_that_the_kernel_drops_is_counted() -> None:
    """With a tiny receive buffer, received and dropped frames add up to the sent ones."""
    async with open_bus("socketcan", "vcan0") as bus:
        bus._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        with raw_sender() as sender:
            for _ in range(300):
                sender.send(struct.pack("=IB3x8s", 0x181, 8, bytes(8)))
            await take(bus, 1)
            markers = await until_marker_received(bus, sender)
        assert bus.counters.kernel_drops > 0
        assert bus.counters.received + bus.counters.kernel_drops == 300 + markers


async def until_marker_received(bus: Bus, sender: socket.socket) -> int:
    """Send frames, each with an identifier of its own, until the last one sent is received; return how many were sent.

    A frame that is received carries the number of frames dropped before it. While the kernel still delivers earlier
    frames, the receive buffer may be full, and the marker is dropped as they are.
    """
    for number in range(1, 100):
        sender.send(struct.pack("=IB3x8s", 0x181 + number, 8, bytes(8)))
        with suppress(TimeoutError):
            async with asyncio.timeout(0.2):
                while all(frame.can_id != 0x181 + number for frame in await bus.receive()):
                    pass
            return number
    pytest.fail("none of 99 markers was received")


async def test_the_socket_stays_open_while_the_link_is_down() -> None:
    """A link that is down is a state and an error in `send`; when it is up again the same socket continues."""
    async with open_bus("socketcan", "vcan0") as bus:
        set_link("down")
        await until_state(bus, BusState.DOWN)
        with pytest.raises(BusDownError, match=r"vcan0: cannot send: Network is down\. Bring it up"):
            await bus.send(SYNC)
        assert (bus.counters.link_down, bus.counters.transmit_failures) == (1, 1)
        set_link("up")
        await bus.send(SYNC)
        assert (await take(bus, 1))[0].sent
        assert bus.state is BusState.ACTIVE


async def test_a_missing_link_is_refused_with_a_remedy() -> None:
    """The error message has the command that creates the link."""
    with pytest.raises(BusOpenError, match=r"cannot open vcan7: No such device.*ip link add dev vcan7 type vcan"):
        async with open_bus("socketcan", "vcan7"):
            pass


async def test_controller_errors_are_states_and_counters() -> None:
    """Warning, passive, bus-off and a bus error of a can-dev link are reported, and link down and up recovers it."""
    with Adapter() as adapter:
        async with open_bus("socketcan", adapter.link) as bus:
            adapter.send_line("sw100100")
            await until_state(bus, BusState.WARNING)
            adapter.send_line("sp130140")
            await until_state(bus, BusState.PASSIVE)
            adapter.send_line("e2ab")
            await until(lambda: bus.counters.errors["bus-error"] > 0, "a bus error")
            adapter.send_line("sb256000")
            await until_state(bus, BusState.OFF)
            assert bus.counters.bus_off == 1
            assert bus.counters.errors["bus-off"] == 1
            assert bus.counters.errors["controller"] >= 2
            adapter.ip("link", "set", adapter.link, "down")
            await until_state(bus, BusState.DOWN)
            adapter.ip("link", "set", adapter.link, "up")
            adapter.frame(0x181, b"regolith")
            frames = [frame for frame in await take(bus, 1) if not frame.error]
            assert [frame.data for frame in frames] == [b"regolith"]
            assert bus.state is BusState.ACTIVE


async def test_a_full_transmit_queue_is_retried_counted_and_reported() -> None:
    """While no node acknowledges, `send` retries and then fails; afterwards it works again."""
    with Adapter() as adapter:
        async with open_bus("socketcan", adapter.link) as bus:
            adapter.block()
            with pytest.raises(BusFullError, match="stayed full"):
                await flood(bus)
            assert bus.counters.transmit_retries > 3
            assert bus.counters.transmit_failures == 1
            adapter.unblock()
            sent = bus.counters.sent
            async with asyncio.timeout(20):
                while bus.counters.sent == sent:
                    try:
                        await bus.send(Frame(0, 0x201, bytes(8)))
                    except BusFullError:
                        await asyncio.sleep(0.05)


async def test_an_unplugged_adapter_is_reported_as_down() -> None:
    """A link that vanishes is the state down, not an exception, and `send` reports it."""
    with Adapter() as adapter:
        async with open_bus("socketcan", adapter.link) as bus:
            adapter.ip("link", "set", adapter.link, "down")
            adapter.unplug()
            await until_state(bus, BusState.DOWN)
            with pytest.raises(BusDownError):
                await bus.send(SYNC)
            adapter.__enter__()  # plugged in again
            async with asyncio.timeout(20):
                while bus.state is not BusState.ACTIVE:
                    adapter.frame(0x181, b"regolith")
                    await asyncio.sleep(0.1)


async def test_the_network_recovers_from_link_down() -> None:
    """Fourteen nodes boot, are lost while the link is down, and boot again afterwards, with kernel times throughout."""
    async with (
        open_bus("socketcan", "vcan0") as rover_bus,
        open_bus("socketcan", "vcan0") as bus,
        asyncio.TaskGroup() as tasks,
    ):
        serving = tasks.create_task(VirtualRover(Bench()).run(rover_bus))
        rig = Rig(None, bus)
        rig.start(tasks, settings(KAPVIK, sync_rate_Hz=10.0, sdo_timeout_s=2.0, boot_up_timeout_s=5.0))
        await until(lambda: len(rig.events_of(NodeBooted)) == 14, "all nodes booted", 60)
        await until(lambda: sum(isinstance(signal, Sync) for signal in rig.signals) > 10, "ten SYNCs")
        assert all(frame.sent for frame in rig.frames if frame.can_id == 0x80)
        set_link("down")
        await rig.wait_for_event(BusStateChanged, state=BusState.DOWN)
        await until(lambda: len(rig.events_of(NodeLost)) == 14, "all nodes lost", 60)
        set_link("up")
        await rig.wait_for_event(BusStateChanged, state=BusState.ACTIVE)
        await until(lambda: len(rig.events_of(NodeBooted)) == 28, "all nodes booted again", 60)
        assert rig.network.counters.sync.failed > 0
        await rig.stop()
        serving.cancel()
