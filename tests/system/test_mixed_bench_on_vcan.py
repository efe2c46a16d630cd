"""Hardware in the loop on SocketCAN: six motors of another stack, virtual load cells, inclinometer and ground."""

from __future__ import annotations

import asyncio
import sys
import time
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from strangers import LOAD, torque_eds

from regolithd.calibration.drivetrain.torque import motor_current
from regolithd.calibration.parameters import Drivetrain
from regolithd.daemon.commands.bench import brakes_of
from regolithd.daemon.config.reader import read_configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.service import Service
from regolithd.daemon.simulator.scenario import Scenario, SensorNoise
from regolithd.daemon.simulator.virtual_rover import VirtualWorld
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.virtual import VirtualRover

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable

    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.master.network import Network

CHANNEL = "vcan1"
VIRTUAL = {*range(11, 17), 21, 22}
WHEEL_RAD_S = 0.3
RATED_mNm = 20_000  # of the brake
MOTORS = [f"{n}:motor:{EDS_FOLDER}/motor.eds:o1018_1=0xFB:o1018_2=0x62100000:o1018_3=0x21100000" for n in range(1, 7)]
CELLS = [f"{n}:load:{EDS_FOLDER}/load-cell.eds" for n in range(11, 17)]
ROVER = f"""
[bus]
channel = "{CHANNEL}"
[sync]
rate_Hz = 5
[nodes]
inclinometer = 21
ground_speed = 22
heartbeat_timeout_ms = 3000
boot_timeout_s = 20
sdo_timeout_s = 5
"""


class Newest:
    """A sink that keeps the newest estimate."""

    last: Estimate | None = None

    def estimate(self, estimate: Estimate) -> None:
        """Keep it."""
        self.last = estimate

    def event(self, event: object) -> None:
        """Show it where the test fails."""
        sys.stdout.write(f"{event}\n")

    async def run(self) -> None:
        """Wait for the end."""
        await asyncio.Event().wait()


async def until(condition: Callable[[], object], what: Callable[[], str], timeout_s: float = 40) -> None:
    """Wait until a condition holds."""
    try:
        async with asyncio.timeout(timeout_s):
            while not condition():  # noqa: ASYNC110  # the condition has no event
                await asyncio.sleep(0.05)
    except TimeoutError:
        pytest.fail(f"not within {timeout_s:g} s: {what()}")


@dataclass
class MixedBench:
    """Slaves of another stack, virtual nodes and the daemon on one bus."""

    world: VirtualWorld
    network: Network
    sink: Newest
    commands: asyncio.StreamWriter

    async def drive(self) -> None:
        """Boot every node, and turn the wheels."""
        await until(lambda: all(each.boots for each in self.network.status.values()), lambda: str(self.network.status))
        await self.network.enable()
        await self.network.set_speed((WHEEL_RAD_S,) * 6)
        await until(lambda: turning(self.sink.last), lambda: shown(self.sink.last, self.world))


@asynccontextmanager
async def running(folder: Path, described: list[str], virtual: set[int], tables: str = "") -> AsyncIterator[MixedBench]:
    """Run strangers, the virtual nodes of these IDs, the brakes of `tables` and the daemon."""
    (folder / "rover.toml").write_text(ROVER + f'[recording]\ndirectory = "{folder}"\n{tables}')
    configuration = read_configuration(folder / "rover.toml")
    strangers = await asyncio.create_subprocess_exec(
        *(sys.executable, Path(__file__).parents[1] / "bench" / "strangers.py", "socketcan", CHANNEL, *described),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    assert strangers.stdin is not None
    assert strangers.stdout is not None
    assert await strangers.stdout.readline() == f"ready: {len(described)} strangers\n".encode()
    world = VirtualWorld(Scenario(noise=SensorNoise.none(), drivetrain=Drivetrain()))
    nodes = configuration.described()
    brakes = brakes_of(configuration, nodes, virtual, world)
    rover = VirtualRover(world, nodes, virtual=virtual, follow_loads=world.follow_loads, on_frame=brakes.take)
    service = Service(configuration, load_models(configuration))
    service.sinks.append(sink := Newest())
    async with open_bus("socketcan", CHANNEL) as bus:
        # In the order in which they end: the rover's task takes the answers to the last writes to the brakes.
        tasks = [asyncio.ensure_future(each) for each in (service.run(), brakes.run(bus), rover.run(bus))]
        try:
            yield MixedBench(world, await service.opened(), sink, strangers.stdin)
        finally:
            for task in tasks:
                task.cancel()
                await asyncio.wait([task])
            strangers.stdin.close()
            await strangers.wait()


@pytest.mark.vcan
async def test_torque_load_and_slip_of_a_mixed_bench_agree_with_the_scenario(tmp_path: Path) -> None:
    """The world follows the foreign motors: the daemon measures its truth, and a brake gets it, and 0 at the end."""
    brake = f"31:motor:{torque_eds(tmp_path)}:o1000_0=0x20192:o6072_0=1000:o6076_0={RATED_mNm}:o6502_0={1 << 3}"
    tables = "[brakes.31]\nwheel = 1\n"
    async with open_bus("socketcan", CHANNEL) as bus:
        async with running(tmp_path, [*MOTORS, brake], VIRTUAL, tables) as bench:
            await bench.drive()
            await until(
                lambda: carry(bench.world, bench.commands) and agrees(bench.sink.last, bench.world),
                lambda: shown(bench.sink.last, bench.world),
            )
            assert not bench.network.intruders.present(time.time_ns()).nodes
            before = targets(await bus.receive())
            assert before[-1] == pytest.approx(torque_permille(bench.world), abs=1)
        assert targets(await bus.receive())[-1] == 0


@pytest.mark.vcan
async def test_virtual_motors_carry_the_load_of_real_cells(tmp_path: Path) -> None:
    """The other way round: the soil under the virtual wheels bears what the foreign load cells measure."""
    async with running(tmp_path, CELLS, {*range(1, 7), 21, 22}) as bench:
        await bench.drive()
        await until(lambda: agrees(bench.sink.last, bench.world), lambda: shown(bench.sink.last, bench.world))
        assert bench.world.truth is not None
        assert bench.world.truth.load_N == pytest.approx([LOAD * 0.01] * 6)


def targets(frames: list[Frame]) -> list[int]:
    """Return the target torques [per mille] that were written to the brake, from the SDO requests."""
    writes = [each.data for each in frames if each.can_id == 0x600 + 31 and each.data[1:3] == b"\x71\x60"]
    return [int.from_bytes(data[4:6], "little", signed=True) for data in writes]


def torque_permille(world: VirtualWorld) -> float:
    """Return the target torque that opposes the soil's torque of wheel 1."""
    assert world.truth is not None
    return float(-1e6 * world.truth.torque_Nm[0] / RATED_mNm)


def turning(estimate: Estimate | None) -> bool:
    """Return whether all wheels have the commanded speed."""
    return estimate is not None and bool(
        np.allclose(estimate.snapshot.motor_speed_rad_s / 1400, WHEEL_RAD_S, rtol=0.01)
    )


def carry(world: VirtualWorld, commands: asyncio.StreamWriter) -> bool:
    """Let the foreign motors, without friction, carry the torque of the soil; False at standstill."""
    truth = world.truth
    if truth is None or not np.all(np.abs(truth.torque_Nm) > 0.1):
        return False
    current = motor_current(truth.torque_Nm, np.full(6, WHEEL_RAD_S * 1400), Drivetrain())
    for number, value in enumerate(current, start=1):
        commands.write(f"current {number} {round(1000 * value)}\n".encode())
    return True


def shown(estimate: Estimate | None, world: VirtualWorld) -> str:
    """Return measured and true values."""
    if estimate is None or world.truth is None:
        return f"{estimate}, {world.truth}"
    measured = (estimate.wheel_torque_Nm, estimate.snapshot.load_N, estimate.slip)
    return f"{measured} against {(world.truth.torque_Nm, world.truth.load_N, world.truth.slip)}"


def agrees(estimate: Estimate, world: VirtualWorld) -> bool:
    """Return whether torque, load and slip are the scenario's: within 1 mA, 0.01 N and the speed's resolution."""
    truth, snapshot = world.truth, estimate.snapshot
    assert truth is not None
    step = 1e-3 * Drivetrain().gain_Nm_per_A
    return bool(
        np.allclose(estimate.wheel_torque_Nm, truth.torque_Nm, atol=2 * step)
        and np.allclose(snapshot.load_N, truth.load_N, rtol=0.01)
        and np.allclose(estimate.slip, truth.slip, atol=0.005)
        and {str(source) for source in estimate.slip_source} == {"ground-speed"}
    )
