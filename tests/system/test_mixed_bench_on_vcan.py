"""Hardware in the loop on SocketCAN: six motors of another stack, virtual load cells, inclinometer and ground."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.drivetrain.torque import motor_current
from regolithd.calibration.parameters import Drivetrain
from regolithd.daemon.config.reader import read_configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.service import Service
from regolithd.daemon.simulator.scenario import Scenario, SensorNoise
from regolithd.daemon.simulator.virtual_rover import VirtualWorld
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.virtual import VirtualRover

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.daemon.pipeline.snapshot import Estimate

CHANNEL = "vcan1"
VIRTUAL = {*range(11, 17), 21, 22}
WHEEL_RAD_S = 0.3
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


@pytest.mark.vcan
async def test_torque_load_and_slip_of_a_mixed_bench_agree_with_the_scenario(tmp_path: Path) -> None:
    """The world follows the foreign motors' PDOs: what the daemon measures is the scenario's truth, without noise."""
    (tmp_path / "rover.toml").write_text(ROVER + f'[recording]\ndirectory = "{tmp_path}"\n')
    configuration = read_configuration(tmp_path / "rover.toml")
    described = [
        f"{n}:motor:{EDS_FOLDER}/motor.eds:o1018_1=0xFB:o1018_2=0x62100000:o1018_3=0x21100000" for n in range(1, 7)
    ]
    strangers = await asyncio.create_subprocess_exec(
        *(sys.executable, Path(__file__).parents[1] / "bench" / "strangers.py", "socketcan", CHANNEL, *described),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    assert strangers.stdin is not None
    assert strangers.stdout is not None
    assert await strangers.stdout.readline() == b"ready: 6 strangers\n"
    world = VirtualWorld(Scenario(noise=SensorNoise.none()))
    rover = VirtualRover(world, configuration.described(), virtual=VIRTUAL, follow_loads=world.follow_loads)
    sink = Newest()
    service = Service(configuration, load_models(configuration))
    service.sinks.append(sink)
    async with open_bus("socketcan", CHANNEL) as bus:
        virtual, running = asyncio.ensure_future(rover.run(bus)), asyncio.ensure_future(service.run())
        try:
            network = await service.opened()
            await until(lambda: all(each.boots for each in network.status.values()), lambda: str(network.status))
            await network.enable()
            await network.set_speed((WHEEL_RAD_S,) * 6)
            await until(lambda: turning(sink.last), lambda: shown(sink.last, world))
            await until(
                lambda: carry(world, strangers.stdin) and agrees(sink.last, world), lambda: shown(sink.last, world)
            )
        finally:
            running.cancel()
            await asyncio.wait([running])
            virtual.cancel()
            await asyncio.wait([virtual])
            strangers.stdin.close()
            await strangers.wait()


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
