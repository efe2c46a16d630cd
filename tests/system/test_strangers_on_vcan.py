"""The daemon with slaves of another stack, each a process, on a SocketCAN link: mixed drives and load cells."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from strangers import CURRENT, LOAD

from regolithd.daemon.config.reader import read_configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.service import Service
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.motor_controller import MOTOR_SPEED

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.daemon.pipeline.snapshot import Estimate

CHANNEL = "vcan1"
PROFILES = ("epos4", "cia402", "epos2", "epos4", "cia402", "epos2")
REVISION = {"epos4": 0x0150_0000, "epos2": 0x2122_0000, "cia402": 1}
WHEEL_RAD_S = 0.2
ROVER = f"""
[bus]
channel = "{CHANNEL}"
[sync]
rate_Hz = 5
[nodes]
heartbeat_timeout_ms = 3000
boot_timeout_s = 20
sdo_timeout_s = 5
[devices.load_cells]
profile = "cia404"
""" + "".join(f'[devices.{number}]\nprofile = "{name}"\n' for number, name in enumerate(PROFILES, start=1))


class Newest:
    """A sink that keeps the newest estimate."""

    estimate_now: Estimate | None = None

    def estimate(self, estimate: Estimate) -> None:
        """Keep it."""
        self.estimate_now = estimate

    def event(self, event: object) -> None:
        """Show it where the test fails."""
        sys.stdout.write(f"{event}\n")

    async def run(self) -> None:
        """Wait for the end."""
        await asyncio.Event().wait()


async def until(condition: Callable[[], object], what: str, timeout_s: float = 90) -> None:
    """Wait until a condition holds."""
    try:
        async with asyncio.timeout(timeout_s):
            while not condition():  # noqa: ASYNC110  # the condition has no event
                await asyncio.sleep(0.05)
    except TimeoutError:
        pytest.fail(f"not within {timeout_s:g} s: {what}")


@pytest.mark.vcan
async def test_mixed_drives_and_cells_of_another_stack_are_driven_over_socketcan(tmp_path: Path) -> None:
    """Six drives of three makes and six CiA 404 cells: booted, turned, and read in SI units; their fault stops all."""
    (tmp_path / "rover.toml").write_text(ROVER + f'[recording]\ndirectory = "{tmp_path}"\n')
    configuration = read_configuration(tmp_path / "rover.toml")
    described = [
        f"{n}:motor:{EDS_FOLDER}/{name}.eds:o1000_0=0x20192:o1018_1=0xFB:o1018_3={REVISION[name]}"
        for n, name in enumerate(PROFILES, start=1)
    ]
    described += [f"{n}:load:{EDS_FOLDER}/cia404.eds:o1000_0=0x20194" for n in range(11, 17)]
    strangers = await asyncio.create_subprocess_exec(
        *(sys.executable, Path(__file__).parents[1] / "bench" / "strangers.py", "socketcan", CHANNEL, *described),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    assert strangers.stdin is not None
    assert strangers.stdout is not None
    assert await strangers.stdout.readline() == b"ready: 12 strangers\n"
    sink = Newest()
    service = Service(configuration, load_models(configuration))
    service.sinks.append(sink)
    running = asyncio.ensure_future(service.run())
    try:
        network = await service.opened()
        await until(lambda: all(each.boots for each in network.status.values()), "all twelve are operational")
        await network.enable()
        await network.set_speed((WHEEL_RAD_S,) * 6)
        wanted = WHEEL_RAD_S * configuration.drivetrain.ratio
        await until(lambda: np.allclose(sink.estimate_now.snapshot[MOTOR_SPEED], wanted, rtol=0.01), "the speed")
        snapshot = sink.estimate_now.snapshot
        per_mille = np.array([name == "cia402" for name in PROFILES])
        assert snapshot.motor_current_A == pytest.approx(np.where(per_mille, 1e-6 * 1000, 1e-3) * CURRENT)
        assert snapshot.load_N == pytest.approx(np.full(6, LOAD * 0.1))
        strangers.stdin.write(b"fault 4\n")
        await until(lambda: np.all(sink.estimate_now.snapshot[MOTOR_SPEED] == 0), "all wheels stopped")
    finally:
        running.cancel()
        await asyncio.wait([running])
        strangers.stdin.close()
        await strangers.wait()
