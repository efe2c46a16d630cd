"""Commands to all drives of the rover together.

Speeds are accepted only after `enable`. Every stop locks the wheels until they are enabled anew, so that a command that
is still under way cannot restart them.
"""

from __future__ import annotations

import asyncio
import math
from typing import TYPE_CHECKING

from regolithd.drivers.errors import BusError, DriveError, DriverError
from regolithd.drivers.master.cia402 import DriveState
from regolithd.drivers.master.status import NodePhase

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence

    from regolithd.drivers.master.drive import Drive
    from regolithd.drivers.master.status import NodeStatus


class Motion:
    """The drives, by node-ID; `status` returns the status of a node."""

    def __init__(self, drives: Mapping[int, Drive], status: Callable[[int], NodeStatus], *, gear_ratio: float) -> None:
        self.moving = False  # not all of the last speeds were 0
        self._drives = drives
        self._status = status
        self._gear_ratio = gear_ratio
        self._stops = 0  # number of stops
        self._locked = "they have not been enabled yet"

    def live(self) -> list[Drive]:
        """Return the drives that are operational."""
        return [drive for node_id, drive in self._drives.items() if self._operational(node_id)]

    async def enable(self) -> None:
        """See `Network.enable`."""
        for node_id in self._drives:
            if not self._operational(node_id):
                status = self._status(node_id)
                raise DriveError(f"the drive is not operational ({status.phase}). {status.text}", node_id=node_id)
        stops = self._stops
        failures = await each(drive.enable() for drive in self._drives.values())
        if self._stops != stops:
            failures.append(DriveError(f"the wheels were stopped meanwhile: {self._locked}"))
        if failures:
            await each(drive.disable() for drive in self.live())
            raise _drive_error(failures)
        self._locked = ""

    async def set_speed(self, wheel_speed_rad_s: Sequence[float]) -> None:
        """See `Network.set_speed`."""
        if self._locked:
            raise DriveError(f"the wheels are locked: {self._locked}", remedy="Enable them")
        for node_id, drive in self._drives.items():
            if not self._operational(node_id):
                raise DriveError("the drive is not operational", node_id=node_id)
            if drive.state is not DriveState.ENABLED:
                raise DriveError(f"the drive is in {drive.state}", node_id=node_id, remedy="Enable it first")
        speeds = [
            (drive, wheel_speed_rad_s[wheel] * self._gear_ratio)
            for drive in self._drives.values()
            if (wheel := drive.remote.node.wheel) is not None
        ]
        _check_limits(speeds)
        self.moving = any(wheel_speed_rad_s)
        try:
            for drive, speed in speeds:
                await drive.turn(speed)
        except BusError:
            self._lock("a command could not be sent to all of them")
            await each(drive.send_quick_stop() for drive in self._drives.values())
            raise

    async def quick_stop(self, why: str = "a quick stop was commanded") -> None:
        """See `Network.quick_stop`."""
        self._lock(why)
        failures = await each(drive.send_quick_stop() for drive in self._drives.values())
        failures += await each(drive.until_stopped() for drive in self.live())
        if failures:
            raise _drive_error(failures)

    async def disable(self) -> None:
        """See `Network.disable`."""
        if self.moving or any(drive.state is DriveState.ENABLED for drive in self.live()):
            await self.quick_stop("they are disabled")
        self._lock("they are disabled")
        failures = await each(drive.disable() for drive in self.live())
        if failures:
            raise _drive_error(failures)

    def _lock(self, why: str) -> None:
        self._stops += 1
        self._locked = why
        self.moving = False

    def _operational(self, node_id: int) -> bool:
        return self._status(node_id).phase is NodePhase.OPERATIONAL


async def each(actions: Iterable[Awaitable[None]]) -> list[DriverError]:
    """Run all concurrently and return the errors, so that the failure of one drive does not affect the others."""
    results = await asyncio.gather(*actions, return_exceptions=True)
    failures = []
    for result in results:
        if isinstance(result, DriverError):
            failures.append(result)
        elif isinstance(result, BaseException):
            raise result
    return failures


def _check_limits(speeds: Sequence[tuple[Drive, float]]) -> None:
    """Raise `DriveError` where a drive would turn more slowly than it is told; half a percent is its rounding."""
    limited = [
        f"node {drive.node_id} {drive.speed_limit_rad_s:.1f}"
        for drive, speed in speeds
        if abs(speed) > 1.005 * drive.speed_limit_rad_s
    ]
    if limited:
        fastest = max(abs(speed) for _, speed in speeds)
        allowed = f"more than object 0x607F allows ({', '.join(limited)} rad/s)"
        what = f"the motors would have to turn at {fastest:.1f} rad/s, {allowed}"
        share = min(drive.speed_limit_rad_s for drive, _ in speeds) / fastest
        raise DriveError(what, remedy=f"Choose at most {math.floor(100 * share)} % of this speed")


def _drive_error(failures: Sequence[DriverError]) -> DriveError:
    """Return one error that names each cause once: of a link that is down, every drive says the same."""
    return DriveError("; ".join(dict.fromkeys(str(failure) for failure in failures)))
