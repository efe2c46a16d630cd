"""Drives a traverse: a distance at constant wheel speed, then a stop.

The duration follows from distance and wheel speed (10 m at 2.2 cm/s: 454.54 s); how far the rover moves in it depends
on the slip.

| condition | the wheels are | ending |
|---|---|---|
| the duration has passed | set to speed 0; once measured to stand still, disabled | finished |
| the same, but a wheel has turned less than the distance | the same | incomplete |
| `stop(quick=False)` | the same | stopped |
| not at a standstill `STANDSTILL_TIMEOUT_S` after speed 0 | quick-stopped, disabled | quick-stopped |
| `stop(quick=True)`, or a drive fails | quick-stopped, disabled | quick-stopped |
| a wheel does not follow (`wheel_motion`) | quick-stopped, disabled | quick-stopped |
| a quick stop is not confirmed in `QUICK_STOP_TIMEOUT_S` | sent both commands | failed |
| the drives cannot be enabled | not driven | failed |
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

REPORT_PERIOD_S = 0.5
STANDSTILL_TIMEOUT_S = 5.0
"""Time for a stop with the drives' ramp; then it becomes a quick stop."""
QUICK_STOP_TIMEOUT_S = 3.0
"""Time for the confirmation of a quick stop. Without one, only the drives' heartbeat consumers can stop them."""


class TraverseError(ValueError):
    """A traverse that is refused; `problems` lists every reason."""

    def __init__(self, problems: list[str]) -> None:
        super().__init__(" ".join(problems))
        self.problems = problems


@dataclass(frozen=True, slots=True)
class Plan:
    """Distance and speed of a traverse. Negative speeds drive backwards; the distance is positive."""

    distance_m: float
    speed_m_s: float
    radius_m: float

    @property
    def duration_s(self) -> float:
        """Time for which the wheels turn [s]."""
        return self.distance_m / abs(self.speed_m_s)

    @property
    def wheel_speed_rad_s(self) -> float:
        """Angular speed of each wheel [rad/s]: ω = v/r."""
        return self.speed_m_s / self.radius_m


def plan_traverse(
    distance_m: float, speed_m_s: float, *, radius_m: float, speed_limit_m_s: float, distance_limit_m: float
) -> Plan:
    """Return the plan of a traverse, or raise `TraverseError` with every limit that it exceeds."""
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
    """How a traverse ended (table above)."""

    FINISHED = "finished"  # complete, and stopped with the drives' ramp
    INCOMPLETE = "incomplete"  # likewise after its duration, but not every wheel has turned the distance
    STOPPED = "stopped"  # stopped early with the drives' ramp, on request
    QUICK_STOPPED = "quick-stopped"  # stopped by a quick stop
    FAILED = "failed"  # the drives could not be enabled, or did not confirm the stop


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a traverse ended, and why."""

    ending: Ending
    elapsed_s: float
    text: str


class Wheels(Protocol):
    """The rover's wheels, as `drivers.master.network.Network` offers them."""

    async def enable(self) -> None:
        """Bring all drives to operation enabled, at speed 0."""

    async def set_speed(self, wheel_speed_rad_s: Sequence[float]) -> None:
        """Turn the six wheels at these speeds, with the drives' ramps."""

    async def quick_stop(self) -> None:
        """Stop all wheels by a quick stop (CiA 402)."""

    async def disable(self) -> None:
        """Disable all drives: no torque."""


class Measured(Protocol):
    """What the wheels are measured to do, as `wheel_motion.WheelMotion` tells."""

    @property
    def problem(self) -> str:
        """Which wheels do not follow the last command; empty where all do."""

    def commanded(self, wheel_speed_rad_s: float) -> None:
        """Note that all wheels have been commanded to turn at this speed."""

    def shortfall(self, distance_m: float, speed_m_s: float) -> str:
        """Return which wheels have turned less than this distance; empty where all have turned it."""

    def standstill_detector(self) -> Callable[[], bool]:
        """Return a function that says whether all six have been measured to stand still since this call."""


class Clock:
    """The monotonic clock; tests replace it."""

    def now_s(self) -> float:
        """Return the time [s] of a monotonic clock."""
        return time.monotonic()

    async def wait(self, event: asyncio.Event, seconds: float) -> None:
        """Return when the event is set or the time has passed."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await event.wait()


@dataclass(slots=True)
class Traverse:
    """One traverse, from enabling the drives to disabling them.

    Parameters
    ----------
    plan
        Distance and speed.
    wheels
        The drives.
    measured
        What the wheels are measured to do.
    report
        Called with the seconds driven, every `REPORT_PERIOD_S`.
    """

    plan: Plan
    wheels: Wheels
    measured: Measured
    report: Callable[[float], None]
    clock: Clock = field(default_factory=Clock)
    _interrupted: asyncio.Event = field(default_factory=asyncio.Event)
    _quick: bool = False
    _why: str = ""
    _began: float | None = None

    def stop(self, why: str, *, quick: bool) -> None:
        """Stop the traverse early: with the drives' ramp, or by a quick stop, which overrides the former."""
        if not self._interrupted.is_set() or (quick and not self._quick):
            self._quick, self._why = quick, why
        self._interrupted.set()

    async def run(self) -> Outcome:
        """Drive it. However it ends, by cancellation too, the wheels are told to stop."""
        try:
            await self.wheels.enable()
            self._began = self.clock.now_s()
            problem = await self._drive()
        except asyncio.CancelledError:
            await self._quick_stop()
            raise
        except DriverError as error:
            problem = self._why or str(error)
        if self._began is None:
            return Outcome(Ending.FAILED, 0.0, problem)
        elapsed = min(self.clock.now_s() - self._began, self.plan.duration_s)
        if problem:
            return await self._end_by_quick_stop(elapsed, problem)
        if self._interrupted.is_set():
            return Outcome(Ending.STOPPED, elapsed, self._why)
        if missing := self.measured.shortfall(self.plan.distance_m, self.plan.speed_m_s):
            return Outcome(Ending.INCOMPLETE, elapsed, missing)
        return Outcome(Ending.FINISHED, elapsed, "the traverse is complete")

    async def _drive(self) -> str:
        """Drive, and stop with the drives' ramp; return why a quick stop is needed, or an empty text."""
        if not self._interrupted.is_set():  # `stop` may have been called while the drives were being enabled
            await self._set_speed(self.plan.wheel_speed_rad_s)
        while not self._interrupted.is_set() and (left := self._left_s()) > 0:
            if self.measured.problem:
                return self.measured.problem
            self.report(self.plan.duration_s - left)
            await self.clock.wait(self._interrupted, min(REPORT_PERIOD_S, left))
        if self._quick:
            return self._why
        return await self._stop_with_ramp()

    def _left_s(self) -> float:
        began = self.clock.now_s() if self._began is None else self._began
        return began + self.plan.duration_s - self.clock.now_s()

    async def _set_speed(self, wheel_speed_rad_s: float) -> None:
        await self.wheels.set_speed((wheel_speed_rad_s,) * 6)
        self.measured.commanded(wheel_speed_rad_s)

    async def _stop_with_ramp(self) -> str:
        await self._set_speed(0.0)
        standing = self.measured.standstill_detector()
        deadline = self.clock.now_s() + STANDSTILL_TIMEOUT_S
        while not standing():
            if self._quick:
                return self._why
            if self.clock.now_s() >= deadline:
                return f"the wheels still turned {STANDSTILL_TIMEOUT_S:g} s after they were told to stop"
            await self.clock.wait(asyncio.Event(), 0.05)
        await self.wheels.disable()
        return ""

    async def _end_by_quick_stop(self, elapsed: float, why: str) -> Outcome:
        problem = await self._quick_stop()
        if problem:
            return Outcome(Ending.FAILED, elapsed, f"{why}; and not every drive confirmed its stop: {problem}")
        return Outcome(Ending.QUICK_STOPPED, elapsed, why)

    async def _quick_stop(self) -> str:
        """Quick-stop and disable; return the first error, or an empty text."""
        problem = ""
        self.measured.commanded(0.0)
        for command in (self.wheels.quick_stop, self.wheels.disable):
            try:
                async with asyncio.timeout(QUICK_STOP_TIMEOUT_S):
                    await command()
            except (DriverError, TimeoutError) as error:
                problem = problem or str(error) or "no answer"
        return problem
