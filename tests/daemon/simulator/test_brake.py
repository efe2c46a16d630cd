"""Brakes in torque mode: python-canopen's LocalNode as the drive, on an in-process bus."""

from __future__ import annotations

import asyncio
import itertools
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pytest
from rig import until
from strangers import Stranger, Strangers, torque_eds

from regolithd.daemon.simulator import brake as brake_module
from regolithd.daemon.simulator.brake import BrakeDescription, Brakes, HeartbeatWatch
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.devices.decoding.pdo import tpdos
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from pathlib import Path

    from regolithd.drivers.can.bus import Bus

CHANNELS = itertools.count()
NODE = 31
BRAKE = BrakeDescription(NODE, wheel=0, gear_ratio=5.0)
MOTOR = NodeDescription(1, MOTOR_CONTROLLER, 0)
MOTOR_PDO = tpdos(MOTOR_CONTROLLER)[0]
SOIL_Nm = 4.0
RATED_mNm = 2000
PROFILE_TORQUE, CYCLIC_TORQUE = 1 << 3, 1 << 9
SETS = {"o1000_0": 0x0002_0192, "o6072_0": 1000, "o6076_0": RATED_mNm, "o6502_0": PROFILE_TORQUE | CYCLIC_TORQUE}


@dataclass
class Rig:
    """A brake of another stack, the frames of a motor, and what was reported."""

    stranger: Stranger
    bus: Bus
    motor_reports: bool = True
    torque_Nm: float = SOIL_Nm
    reports: list[str] = field(default_factory=list)
    killed: bool = False

    @property
    def target(self) -> int:
        """Target torque [per mille]."""
        return self.stranger.get(0x6071, signed=True)

    def torques(self) -> np.ndarray:
        """Return the wheels' torques."""
        return np.array([self.torque_Nm, 0, 0, 0, 0, 0])

    async def report_speed(self) -> None:
        """Send the motor's TPDO twenty times a second."""
        while True:
            if self.motor_reports:
                await self.bus.send(Frame(0, MOTOR_PDO.cob_id(MOTOR.node_id), MOTOR_PDO.pack(0x1237, 60, 3000)))
            await asyncio.sleep(0.05)


async def read(bus: Bus, brakes: Brakes) -> None:
    """Pass the bus's frames on, as the virtual rover does."""
    async for batch in bus:
        for frame in batch:
            brakes.take(frame)


@asynccontextmanager
async def braking(folder: Path, **sets: int) -> AsyncIterator[tuple[Rig, asyncio.Task[None]]]:
    """Run a brake and its bench; yield the rig, and the task that brakes."""
    channel = f"brakes-{next(CHANNELS)}"
    with Strangers("virtual", channel) as strangers:
        stranger = strangers.add(NODE, str(torque_eds(folder)), "motor", **(SETS | sets))
        async with (
            open_bus("virtual", channel) as bus,
            open_bus("virtual", channel) as other,
            asyncio.TaskGroup() as tasks,
        ):
            rig = Rig(stranger, other)
            watch = HeartbeatWatch(11, 0.6)
            brakes = Brakes([BRAKE], [MOTOR], rig.torques, stale_after_s=0.4, watch=watch, report=rig.reports.append)
            reading = tasks.create_task(read(bus, brakes))
            unsilenced = bus.send

            async def send(frame: Frame) -> None:
                if not rig.killed:
                    await unsilenced(frame)

            bus.send = send  # type: ignore[method-assign]
            running, reporting = tasks.create_task(brakes.run(bus)), tasks.create_task(rig.report_speed())
            yield rig, running
            running.cancel()
            reporting.cancel()
            await asyncio.wait([running])
            reading.cancel()


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shorten the pauses."""
    monkeypatch.setattr(brake_module, "PERIOD_S", 0.02)
    monkeypatch.setattr(brake_module, "RETRY_S", 0.1)


@pytest.mark.parametrize(
    ("wheel_torque_Nm", "mirrored", "limit", "permille"),
    [
        (4.0, False, 1000, -400),  # 4 N·m through 5 : 1, of 2 N·m
        (-4.0, False, 1000, 400),
        (4.0, True, 1000, 400),
        (40.0, False, 1000, -1000),
        (-40.0, False, 250, 250),
        (float("nan"), False, 1000, 0),
        (float("inf"), False, 1000, 0),
    ],
)
def test_the_target_opposes_the_wheel_and_is_bounded(
    wheel_torque_Nm: float, mirrored: bool, limit: int, permille: int
) -> None:
    """Per mille of the rated torque at the brake's shaft; 0 where the torque is unknown."""
    described = BrakeDescription(NODE, 0, gear_ratio=5.0, mirrored=mirrored)
    assert described.target_permille(wheel_torque_Nm, 2.0, limit) == permille


@pytest.mark.parametrize(
    ("supported", "mode"), [(PROFILE_TORQUE | CYCLIC_TORQUE, 4), (CYCLIC_TORQUE, 10), (PROFILE_TORQUE, 4)]
)
async def test_the_brake_gets_the_torque_of_the_soil(tmp_path: Path, supported: int, mode: int) -> None:
    """It is enabled in a torque mode that it has, and the target follows the soil."""
    async with braking(tmp_path, o6502_0=supported) as (rig, _):
        await until(lambda: rig.target == -400, "4 N·m through 5 : 1, of 2 N·m")
        assert (rig.stranger.state, rig.stranger.get(0x6060)) == ("enabled", mode)
        assert rig.stranger.get(0x1016, 1) == 11 << 16 | 600
        rig.torque_Nm = -8.0
        await until(lambda: rig.target == 800, "the target follows")
        assert rig.reports == []


async def test_the_torque_is_bounded_by_the_device(tmp_path: Path) -> None:
    """No more than 0x6072 is asked for."""
    async with braking(tmp_path, o6072_0=300) as (rig, _):
        rig.torque_Nm = 100.0
        await until(lambda: rig.target == -300, "the largest torque")
        await asyncio.sleep(0.1)
        assert rig.target == -300


async def test_without_the_motors_pdos_the_torque_is_zero(tmp_path: Path) -> None:
    """It falls to 0 when the PDOs end, and returns with them."""
    async with braking(tmp_path) as (rig, _):
        await until(lambda: rig.target == -400, "the brake brakes")
        rig.motor_reports = False
        await until(lambda: rig.target == 0, "the PDOs are stale")
        assert rig.stranger.state == "enabled"
        rig.motor_reports = True
        await until(lambda: rig.target == -400, "it brakes again")


async def test_when_the_bench_stops_the_brake_is_released(tmp_path: Path) -> None:
    """Torque 0, and the voltage is disabled, before the bench has ended."""
    async with braking(tmp_path) as (rig, running):
        await until(lambda: rig.target == -400, "the brake brakes")
        running.cancel()
        await asyncio.wait([running])
        assert (rig.target, rig.stranger.state) == (0, "disabled")


async def test_a_brake_stops_by_itself_when_the_bench_is_killed(tmp_path: Path) -> None:
    """Without the heartbeat of the bench's virtual node it leaves operation enabled, though nothing more is written."""
    async with braking(tmp_path) as (rig, _):
        for _ in range(4):
            await rig.bus.send(Frame(0, 0x70B, b"\5"))
            await asyncio.sleep(0.2)
        await until(lambda: rig.target == -400, "the brake brakes")
        rig.stranger.lost_master = 0
        rig.killed = True
        await rig.bus.send(Frame(0, 0x70B, b"\5"))
        await until(lambda: rig.stranger.lost_master, "the heartbeat is lost")
        await until(lambda: rig.stranger.state == "disabled", "the voltage is off")


async def test_a_brake_that_was_reset_is_configured_anew(tmp_path: Path) -> None:
    """After a reset it is in no torque mode; it is not enabled before the mode is written again."""
    async with braking(tmp_path) as (rig, _):
        await until(lambda: rig.target == -400, "the brake brakes")
        rig.stranger.command(0, bytes((129, NODE)), 0.0)
        await until(lambda: rig.reports, "the reset is reported")
        await until(lambda: rig.target == -400, "it brakes again")
        assert rig.stranger.get(0x6060) == 4
        assert "node 31" in rig.reports[0]


async def test_a_fault_ends_the_braking(tmp_path: Path) -> None:
    """The error code is reported, and the drive is not enabled again."""
    async with braking(tmp_path) as (rig, _):
        await until(lambda: rig.target == -400, "the brake brakes")
        rig.stranger.fault()
        await until(lambda: rig.reports, "the fault is reported")
        assert "node 31: fault (error code 0x2310): no torque until the bench is started again" in rig.reports[0]
        await asyncio.sleep(0.3)
        assert rig.stranger.state == "fault"


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        ({"o1000_0": 0x0002_0194}, "0x1000:00: its device type is 0x00020194, no drive of CiA 402"),
        ({"o6076_0": 0}, "0x6076:00: the rated torque is 0. Write it, in mN·m, with the maker's program"),
        ({"o6502_0": 1 << 2}, "0x6502:00: it has neither profile torque nor cyclic synchronous torque mode"),
    ],
)
async def test_what_cannot_brake_is_not_enabled(tmp_path: Path, sets: dict[str, int], said: str) -> None:
    """Device type, rated torque and modes are read first; what is wrong is said once, with the object."""
    async with braking(tmp_path, **sets) as (rig, _):
        await until(lambda: rig.reports, "the refusal is reported")
        await asyncio.sleep(0.3)
        assert len(rig.reports) == 1
        assert said in rig.reports[0]
        assert rig.stranger.state == "disabled"


def test_a_brake_without_a_gear_turns_with_its_wheel() -> None:
    """Half of the rated torque against the wheel's is 500 per mille the other way; its limit is kept both ways."""
    plain = BrakeDescription(NODE, wheel=0)
    assert (plain.gear_ratio, plain.mirrored) == (1.0, False)
    assert plain.target_permille(2.0, 4.0) == -500
    assert plain.target_permille(-9.0, 4.0) == 1000
    assert plain.target_permille(9.0, 4.0, limit_permille=300) == -300
    assert plain.target_permille(float("nan"), 4.0) == 0
