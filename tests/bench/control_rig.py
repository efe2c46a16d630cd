"""A control socket that serves six simulated drives, and a client that sends and reads lines."""

import asyncio
import grp
import json
import os
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from estimates import estimate
from subscriber import until

from regolithd.daemon.config.configuration import Configuration, Control, Recording, SyncTiming
from regolithd.daemon.control.protocol import REPLY, Ended, Progress
from regolithd.daemon.control.server import ControlSink
from regolithd.daemon.pipeline.snapshot import ROW, Snapshot
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER, MOTOR_SPEED
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.errors import DriveError
from regolithd.drivers.master.status import NodePhase, NodeStatus

GROUP = grp.getgrgid(os.getgid()).gr_name


@dataclass
class Rover:
    """Six drives that carry out each command and keep a list of them."""

    told: list[str] = field(default_factory=list)
    phase: NodePhase = NodePhase.OPERATIONAL
    problem: str = ""
    speeds: np.ndarray = field(default_factory=lambda: np.zeros(6))  # [rad/s at the wheel]
    shares: np.ndarray = field(default_factory=lambda: np.ones(6))  # of the commanded speed, at which each wheel turns

    @property
    def status(self) -> Mapping[int, NodeStatus]:
        """State of each node; the third is in `phase`."""
        return {
            n: NodeStatus(
                NodeDescription(n, MOTOR_CONTROLLER, n - 1),
                self.phase if n == 3 else NodePhase.OPERATIONAL,
                text="said",
            )
            for n in range(1, 7)
        }

    async def enable(self) -> None:
        """Record the command to enable."""
        self.told.append("enable")

    async def set_speed(self, wheel_speed_rad_s: Sequence[float]) -> None:
        """Record the speed."""
        self.told.append(f"speed {wheel_speed_rad_s[0]:.3f}")
        self.speeds = self.shares * wheel_speed_rad_s

    async def quick_stop(self) -> None:
        """Record the quick stop."""
        self.told.append("quick stop")
        self.speeds = np.zeros(6)

    async def disable(self) -> None:
        """Record the command to disable."""
        self.told.append("disable")
        if self.problem:
            raise DriveError(self.problem, node_id=3)


@asynccontextmanager
async def serving(folder: Path, rover: Rover | None, **control: Any) -> AsyncIterator[tuple[ControlSink, Path]]:
    """Serve a rover whose wheels turn as they are told, measured 100 times a second."""
    path = folder / "control.sock"
    configuration = Configuration(
        control=Control.model_validate({"socket": path, "group": GROUP} | control),
        recording=Recording(directory=folder),
        sync=SyncTiming(rate_Hz=100.0),
    )
    sink = ControlSink(configuration, lambda: rover)
    task = asyncio.create_task(sink.run())

    async def measure() -> None:
        while True:
            values = np.zeros((10, 6))
            if rover is not None:
                values[ROW[MOTOR_SPEED]] = rover.speeds * configuration.drivetrain.ratio
            sink.estimate(estimate_of(Snapshot(0, time.time_ns(), values)))
            await asyncio.sleep(0.01)

    measuring = asyncio.create_task(measure())
    try:
        await until(path.exists)
        yield sink, path
    finally:
        for each in (measuring, task):
            each.cancel()
            with suppress(asyncio.CancelledError):
                await each
        while Client.opened:
            writer = Client.opened.pop().writer
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()


def estimate_of(snapshot: Snapshot) -> Any:
    """Return an estimate of this snapshot."""
    whole = estimate()
    object.__setattr__(whole, "snapshot", snapshot)
    return whole


class Client:
    """Sends and reads lines; `serving` closes all clients at its end."""

    opened: ClassVar[list["Client"]] = []

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader = reader
        self.writer = writer

    @classmethod
    async def to(cls, path: Path) -> "Client":
        """Connect."""
        client = cls(*await asyncio.open_unix_connection(path))
        cls.opened.append(client)
        return client

    def say(self, request: object) -> None:
        """Send a line."""
        self.writer.write((request if isinstance(request, bytes) else json.dumps(request).encode()) + b"\n")

    async def hear(self) -> Any:
        """Return the next line, as one of the protocol's replies."""
        async with asyncio.timeout(20):
            return REPLY.validate_json(await self.reader.readline())

    async def ask(self, request: object) -> Any:
        """Send a line and return the reply."""
        self.say(request)
        return await self.hear()

    async def hear_end(self) -> Ended:
        """Return the end of a traverse; only progress may come before."""
        while isinstance(reply := await self.hear(), Progress):
            pass
        assert isinstance(reply, Ended)
        return reply


SHORT = {"command": "traverse", "distance_m": 0.01, "speed_m_s": 0.05}
LONG = {"command": "traverse", "distance_m": 10.0, "speed_m_s": 0.022}
