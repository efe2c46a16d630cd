"""A traverse as Kapvik did it: so far, at constant wheel speed, then a clean stop.

The time follows from distance and wheel speed (10 m at 2.2 cm/s: 454.54 s); how far the rover comes in it depends on
the slip, which is what is to be measured. Whatever goes wrong on the way ends in a quick stop.
"""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol

from regolithd.drivers.errors import DriverError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

REPORT_EVERY_S = 0.5
STAND_WITHIN_S = 5.0
"""A clean stop may take this long; then it becomes a quick stop."""
GIVE_UP_AFTER_S = 3.0
"""A quick stop that is not confirmed by then: the drives' own heartbeat consumers are what is left."""


class TraverseError(ValueError):
    """A traverse that is not to be driven; `problems` says everything that is wrong with it."""

    def __init__(self, problems: list[str]) -> None:
        super().__init__(" ".join(problems))
        self.problems = problems


@dataclass(frozen=True, slots=True)
class Plan:
    """What is to be driven. Negative speeds drive backwards; the distance is positive."""

    distance_m: float
    speed_m_s: float
    radius_m: float

    @property
    def duration_s(self) -> float:
        """How long the wheels turn."""
        return self.distance_m / abs(self.speed_m_s)

    @property
    def wheel_speed_rad_s(self) -> float:
        """How fast each wheel turns: its rim moves at the speed wanted, ω = v/r."""
        return self.speed_m_s / self.radius_m


def plan_traverse(
    distance_m: float, speed_m_s: float, *, radius_m: float, speed_limit_m_s: float, distance_limit_m: float
) -> Plan:
    """Return the plan of a traverse; raise `TraverseError` with everything that speaks against it."""
    problems = []
    if not 0 < distance_m <= distance_limit_m:
        problems.append(f"The distance must be above 0 and at most {distance_limit_m:g} m, not {distance_m:g}.")
    if not 0 < abs(speed_m_s) <= speed_limit_m_s:
        problems.append(
            f"The speed must be at most {speed_limit_m_s:g} m/s (negative: backwards) and not 0, not {speed_m_s:g}."
        )
    if problems:
        raise TraverseError([*problems, "The limits are in rover.toml: [control]."])
    return Plan(distance_m, speed_m_s, radius_m)


class Ending(StrEnum):
    """How a traverse ended."""

    FINISHED = "finished"  # all of it driven, and stopped clean
    STOPPED = "stopped"  # stopped clean before its time, because somebody wanted it
    QUICK_STOPPED = "quick-stopped"  # stopped at once, because it had to be
    FAILED = "failed"  # the drives could not be enabled, or did not confirm that they stand


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a traverse ended, and why."""

    ending: Ending
    elapsed_s: float
    text: str


class Wheels(Protocol):
    """The rover's wheels, as `drivers.master.network.Network` offers them."""

    async def enable(self) -> None:
        """Bring all drives to operation enabled, standing still."""

    async def set_speed(self, wheel_speed_rad_s: Sequence[float]) -> None:
        """Turn the six wheels at these speeds, with the drives' own ramps."""

    async def quick_stop(self) -> None:
        """Stop all wheels now."""

    async def disable(self) -> None:
        """Take the power off the motors."""


class Clock:
    """The time that a traverse is driven by; tests have one of their own."""

    def now_s(self) -> float:
        """Return the time [s] since whenever; it never jumps."""
        return time.monotonic()

    async def wait(self, event: asyncio.Event, seconds: float) -> None:
        """Return when the event is set or the time is over."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await event.wait()


@dataclass(slots=True)
class Traverse:
    """One traverse, from enabling the drives to taking their power off.

    Parameters
    ----------
    plan
        What to drive.
    wheels
        What to drive it with.
    watch
        Begins to watch the wheels, and returns what says whether all six have been measured to stand since.
    report
        Called with the seconds driven, about twice a second.
    """

    plan: Plan
    wheels: Wheels
    watch: Callable[[], Callable[[], bool]]
    report: Callable[[float], None]
    clock: Clock = field(default_factory=Clock)
    _interrupted: asyncio.Event = field(default_factory=asyncio.Event)
    _quick: bool = False
    _why: str = ""
    _began: float | None = None

    def stop(self, why: str, *, quick: bool) -> None:
        """Have it end before its time: with the drives' ramp, or at once. A quick stop overrides a clean one."""
        if not self._interrupted.is_set() or (quick and not self._quick):
            self._quick, self._why = quick, why
        self._interrupted.set()

    async def run(self) -> Outcome:
        """Drive it. However it ends, also by cancellation, the wheels are told to stop."""
        try:
            await self.wheels.enable()
            self._began = self.clock.now_s()
            trouble = await self._drive()
        except asyncio.CancelledError:
            await self._stop_at_once()
            raise
        except DriverError as error:
            trouble = self._why or str(error)
        if self._began is None:
            return Outcome(Ending.FAILED, 0.0, trouble)
        elapsed = min(self.clock.now_s() - self._began, self.plan.duration_s)
        if trouble:
            return await self._end_quickly(elapsed, trouble)
        if self._interrupted.is_set():
            return Outcome(Ending.STOPPED, elapsed, self._why)
        return Outcome(Ending.FINISHED, elapsed, "the traverse is complete")

    async def _drive(self) -> str:
        """Drive and stop clean; return why this must become a quick stop, or nothing."""
        if not self._interrupted.is_set():  # it may have been while the drives were being enabled
            await self.wheels.set_speed((self.plan.wheel_speed_rad_s,) * 6)
        while not self._interrupted.is_set() and (left := self._left_s()) > 0:
            self.report(self.plan.duration_s - left)
            await self.clock.wait(self._interrupted, min(REPORT_EVERY_S, left))
        if self._quick:
            return self._why
        return await self._stop_clean()

    def _left_s(self) -> float:
        began = self.clock.now_s() if self._began is None else self._began
        return began + self.plan.duration_s - self.clock.now_s()

    async def _stop_clean(self) -> str:
        await self.wheels.set_speed((0.0,) * 6)
        standing = self.watch()
        deadline = self.clock.now_s() + STAND_WITHIN_S
        while not standing():
            if self._quick:
                return self._why
            if self.clock.now_s() >= deadline:
                return f"the wheels still turned {STAND_WITHIN_S:g} s after they were told to stop"
            await self.clock.wait(asyncio.Event(), 0.05)
        await self.wheels.disable()
        return ""

    async def _end_quickly(self, elapsed: float, why: str) -> Outcome:
        trouble = await self._stop_at_once()
        if trouble:
            return Outcome(Ending.FAILED, elapsed, f"{why}; and not every drive confirmed its stop: {trouble}")
        return Outcome(Ending.QUICK_STOPPED, elapsed, why)

    async def _stop_at_once(self) -> str:
        """Quick-stop and take the power off; return what went wrong, or nothing."""
        trouble = ""
        for command in (self.wheels.quick_stop, self.wheels.disable):
            try:
                async with asyncio.timeout(GIVE_UP_AFTER_S):
                    await command()
            except (DriverError, TimeoutError) as error:
                trouble = trouble or str(error) or "no answer"
        return trouble
