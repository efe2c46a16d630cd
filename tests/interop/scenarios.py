"""The scenarios that every stack runs: two drives and a load cell on one bus, driven by regolithd's master."""

from __future__ import annotations

import asyncio
import signal
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.devices.decoding.signals import Reading
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import MOTOR_CURRENT, MOTOR_SPEED
from regolithd.drivers.master.events import MotionStopped, NodeBooted, NodeEmergency, NodeLost
from regolithd.drivers.master.network import Network, NetworkSettings
from regolithd.drivers.virtual import KAPVIK

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Sequence

    from stacks import Slave, Stack

    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.devices.decoding.signals import Signal
    from regolithd.drivers.devices.device import Quantity
    from regolithd.drivers.master.events import NetworkEvent

NODES = tuple(node for node in KAPVIK if node.node_id in {1, 2, 11})
SETTINGS = NetworkSettings(
    NODES,
    sync_rate_Hz=5.0,
    gear_ratio=1.0,
    sdo_timeout_s=3.0,
    boot_up_timeout_s=10.0,
    retry_after_s=2.0,
    node_lost_after_s=2.0,
    master_lost_after_s=2.0,
)
SPEED = 100.0  # rad/s at the motor
CURRENT_A, LOAD_N = 0.055, 47.25
TIMEOUT_S = 30.0


@dataclass
class Rig:
    """The slaves of one stack, and the master's network."""

    stack: Stack
    channel: str
    slaves: dict[int, Slave] = field(default_factory=dict)
    events: list[NetworkEvent] = field(default_factory=list)
    latest: dict[tuple[int, Quantity], float] = field(default_factory=dict)
    network: Network | None = None

    def take(self, signals: Sequence[Signal]) -> None:
        """Keep the newest values."""
        for each in signals:
            if isinstance(each, Reading):
                self.latest |= {(each.node_id, quantity): value for quantity, value in each.values}

    def told(self, kind: type, node_id: int) -> bool:
        """Return whether there was such an event about a node."""
        return any(isinstance(event, kind) and event.node_id == node_id for event in self.events)

    def turns(self, node_id: int, speed: float) -> bool:
        """Return whether a drive has this speed."""
        return abs(self.latest.get((node_id, MOTOR_SPEED), float("nan")) - speed) < 0.5

    def start(self, node_id: int) -> None:
        """Start a slave."""
        kind = next("motor" if node.device.commanded else "load" for node in NODES if node.node_id == node_id)
        self.slaves[node_id] = self.stack.start(self.channel, node_id, kind)

    @property
    def master(self) -> Network:
        """The running network."""
        assert self.network is not None
        return self.network


async def until(condition: Callable[[], object], what: str) -> None:
    """Wait until a condition holds."""
    try:
        async with asyncio.timeout(TIMEOUT_S):
            while not condition():  # noqa: ASYNC110
                await asyncio.sleep(0.02)
    except TimeoutError:
        raise AssertionError(f"not within {TIMEOUT_S:g} s: {what}") from None


async def boot(rig: Rig) -> None:
    """Identified, configured with read-back, operational."""
    await until(lambda: all(rig.told(NodeBooted, node.node_id) for node in NODES), f"booted: {rig.master.status}")


async def traverse(rig: Rig) -> None:
    """Enabled and turned; current, speed and load in SI units."""
    await rig.master.enable()
    await rig.master.set_speed((SPEED,) * 6)
    await until(lambda: rig.turns(1, SPEED) and rig.turns(2, SPEED), "both drives turn")
    assert abs(rig.latest[1, MOTOR_CURRENT] - CURRENT_A) < 1e-9, rig.latest
    assert abs(rig.latest[11, LOAD] - LOAD_N) < 1e-9, rig.latest


async def drive_fault(rig: Rig) -> None:
    """EMCY told, and the other drive stopped."""
    rig.slaves[1].fail()
    await until(lambda: rig.told(MotionStopped, 1), "motion stopped")
    await until(lambda: rig.turns(2, 0.0), "the other drive stands")
    await until(lambda: rig.told(NodeEmergency, 1), "EMCY")


async def reset(rig: Rig) -> None:
    """Fault reset by enabling; both turn again."""
    await traverse(rig)


async def killed_node(rig: Rig) -> None:
    """Lost, the other stopped; booted again when it returns."""
    rig.events.clear()
    rig.slaves[2].kill()
    await until(lambda: rig.told(NodeLost, 2), "lost")
    await until(lambda: rig.turns(1, 0.0), "the other drive stands")
    rig.start(2)
    await until(lambda: rig.told(NodeBooted, 2), "booted again")


async def killed_daemon(rig: Rig) -> None:
    """`kill -9` of the master: the drive stops by itself."""
    driver = await asyncio.create_subprocess_exec(
        *(sys.executable, str(Path(__file__).with_name("run.py")), "drive", rig.channel), stdout=asyncio.subprocess.PIPE
    )
    assert driver.stdout is not None
    async with asyncio.timeout(3 * TIMEOUT_S):
        line = await driver.stdout.readline()
    assert line == b"driving\n", line
    driver.send_signal(signal.SIGKILL)
    await driver.wait()
    await asyncio.sleep(SETTINGS.master_lost_after_s + 1.0)
    async with open_bus("socketcan", rig.channel) as bus:
        speeds = [await asked_speed(bus, node_id) for node_id in (1, 2)]
    assert speeds == [0, 0], speeds


async def asked_speed(bus: Bus, node_id: int) -> int:
    """Return a drive's speed [rpm], read by SDO."""
    from regolithd.drivers.canopen.sdo_client import SdoClient  # noqa: PLC0415

    sdo = SdoClient(bus, node_id, timeout_s=3.0)

    async def read() -> None:
        async for batch in bus:
            for frame in batch:
                if frame.can_id == 0x580 + node_id:
                    sdo.handle(frame)

    reader = asyncio.ensure_future(read())
    try:
        return await sdo.read_number(0x606C, signed=True)
    finally:
        reader.cancel()
        await asyncio.wait([reader])


SCENARIOS = (boot, traverse, drive_fault, reset, killed_node)


async def run_all(stack: Stack, channel: str) -> AsyncIterator[tuple[str, str]]:
    """Yield each scenario's name and outcome: `passed`, or why not."""
    rig = Rig(stack, channel)
    try:
        for node in NODES:
            rig.start(node.node_id)
        await asyncio.sleep(2.0)
        async with open_bus("socketcan", channel) as bus:
            rig.network = Network(bus, SETTINGS, on_signals=rig.take, on_event=rig.events.append)
            running = asyncio.ensure_future(rig.network.run())
            for scenario in SCENARIOS:
                yield scenario.__name__, await outcome(scenario(rig))
            running.cancel()
            await asyncio.wait([running])
        yield killed_daemon.__name__, await outcome(killed_daemon(rig))
    finally:
        for slave in rig.slaves.values():
            slave.kill()


async def outcome(scenario: object) -> str:
    """Return `passed`, or why not."""
    try:
        await scenario  # type: ignore[misc]
    except Exception as error:  # noqa: BLE001  # whatever goes wrong is this stack's result
        return f"failed: {type(error).__name__}: {' '.join(str(error).split())[:160]}"
    return "passed"


async def drive(channel: str) -> None:
    """Boot, enable and turn the drives; print `driving`, and go on until killed."""
    events: list[NetworkEvent] = []
    values = Rig(None, channel)  # type: ignore[arg-type]
    async with open_bus("socketcan", channel) as bus:
        network = Network(bus, replace(SETTINGS), on_signals=values.take, on_event=events.append)
        running = asyncio.ensure_future(network.run())
        values.events = events
        await until(lambda: all(values.told(NodeBooted, node.node_id) for node in NODES), f"booted: {events}")
        await network.enable()
        await network.set_speed((SPEED,) * 6)
        await until(lambda: values.turns(1, SPEED), "turning")
        sys.stdout.write("driving\n")
        sys.stdout.flush()
        await running
