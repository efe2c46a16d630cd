"""A traverse takes the time that follows from distance and speed, and always ends with the wheels told to stop."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import pytest
from subscriber import until

from regolithd.daemon.control.traverse import Clock, Ending, Outcome, Plan, Traverse, TraverseError, plan_traverse
from regolithd.drivers.errors import DriveError

KAPVIK = {"radius_m": 0.075, "speed_limit_m_s": 0.05, "distance_limit_m": 1000.0}


class QuickClock(Clock):
    """A clock that advances only when it is waited for; `at` runs functions at given times."""

    def __init__(self, at: Sequence[tuple[float, Callable[[], None]]] = ()) -> None:
        self.now = 100.0
        self.at = [(100.0 + seconds, action) for seconds, action in at]

    def now_s(self) -> float:
        """Return the current time."""
        return self.now

    async def wait(self, event: asyncio.Event, seconds: float) -> None:
        """Advance the time."""
        await asyncio.sleep(0)
        until = self.now + seconds
        while self.at and self.at[0][0] <= until and not event.is_set():
            self.now, action = self.at.pop(0)
            action()
        if not event.is_set():
            self.now = until


@dataclass
class Rover:
    """Records the commands; may refuse some."""

    told: list[object] = field(default_factory=list)
    refuses: dict[str, str] = field(default_factory=dict)
    stands: bool = True
    problem: str = ""
    missing: str = ""

    async def _do(self, what: str, value: object = None) -> None:
        self.told.append(what if value is None else (what, value))
        if what in self.refuses:
            raise DriveError(self.refuses[what], node_id=3)

    async def enable(self) -> None:
        """Record the command to enable."""
        await self._do("enable")

    async def set_speed(self, wheel_speed_rad_s: Sequence[float]) -> None:
        """Record the speed."""
        assert len(wheel_speed_rad_s) == 6
        await self._do("speed", wheel_speed_rad_s[0])

    async def quick_stop(self) -> None:
        """Record the quick stop."""
        await self._do("quick stop")

    async def disable(self) -> None:
        """Record the command to disable."""
        await self._do("disable")

    def commanded(self, wheel_speed_rad_s: float) -> None:
        """Record nothing: `set_speed` has."""

    def shortfall(self, distance_m: float, speed_m_s: float) -> str:
        """Return what is missing."""
        assert (distance_m, speed_m_s) == (10.0, 0.022)
        return self.missing

    def standstill_detector(self) -> Callable[[], bool]:
        """Return a function that says whether the wheels stand still."""
        return lambda: self.stands


def traverse(rover: Rover, clock: Clock, reports: list[float] | None = None) -> Traverse:
    """Return a traverse of Kapvik."""
    return Traverse(plan(), rover, rover, (reports if reports is not None else []).append, clock)


def plan() -> Plan:
    """Return 10 m at 2.2 cm/s."""
    return plan_traverse(10.0, 0.022, **KAPVIK)


def test_ten_metres_at_kapviks_speed_take_454_54_seconds() -> None:
    """10 m at 2.2 cm/s take 454.54 s, as in the paper."""
    assert plan().duration_s == pytest.approx(454.545454, abs=1e-6)
    assert plan().wheel_speed_rad_s == pytest.approx(0.293333, abs=1e-6)
    assert plan_traverse(1.0, -0.02, **KAPVIK).wheel_speed_rad_s < 0
    assert plan_traverse(1.0, -0.02, **KAPVIK).duration_s == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("distance", "speed", "problems"),
    [
        (0.0, 0.022, ["distance"]),
        (-1.0, 0.022, ["distance"]),
        (1001.0, 0.022, ["at most 1000 m"]),
        (float("nan"), float("nan"), ["distance", "speed"]),
        (10.0, 0.0, ["speed"]),
        (10.0, 0.051, ["at most 0.05 m/s"]),
        (10.0, -0.051, ["at most 0.05 m/s"]),
        (float("inf"), 9.0, ["distance", "speed"]),
    ],
)
def test_what_must_not_be_driven_is_refused_with_every_reason(
    distance: float, speed: float, problems: list[str]
) -> None:
    """Every exceeded limit is named at once, and where the limits are configured."""
    with pytest.raises(TraverseError) as caught:
        plan_traverse(distance, speed, **KAPVIK)
    assert len(caught.value.problems) == len(problems) + 1
    for problem in problems:
        assert problem in str(caught.value)
    assert "[control]" in str(caught.value)


async def test_it_turns_constantly_for_its_time_and_stops_clean() -> None:
    """The wheels turn at one speed for the duration, stop, and are disabled without a quick stop."""
    rover, clock, reports = Rover(), QuickClock(), []
    outcome = await traverse(rover, clock, reports).run()
    assert outcome.ending is Ending.FINISHED
    assert outcome.elapsed_s == pytest.approx(plan().duration_s)
    assert rover.told == ["enable", ("speed", plan().wheel_speed_rad_s), ("speed", 0.0), "disable"]
    assert clock.now - 100.0 == pytest.approx(454.545454, abs=1e-6)
    assert len(reports) == pytest.approx(910, abs=1)
    assert reports == sorted(reports)


async def test_a_wheel_that_does_not_follow_ends_it_by_a_quick_stop() -> None:
    """The traverse ends when a wheel is measured not to follow, with the reason."""
    rover, clock = Rover(), QuickClock()
    clock.at = [(103.0, lambda: setattr(rover, "problem", "wheel 3 at 0.000"))]
    outcome = await traverse(rover, clock).run()
    assert outcome == Outcome(Ending.QUICK_STOPPED, pytest.approx(3.5, abs=0.5), "wheel 3 at 0.000")
    assert rover.told[-2:] == ["quick stop", "disable"]


async def test_a_distance_that_was_not_turned_is_not_complete() -> None:
    """The traverse takes its time, and its end says which wheels have turned less."""
    outcome = await traverse(Rover(missing="wheel 3"), QuickClock()).run()
    assert outcome == Outcome(Ending.INCOMPLETE, pytest.approx(plan().duration_s), "wheel 3")


async def interrupted(rover: Rover, *, quick: bool) -> Outcome:
    """Drive, and stop it after 100 s."""
    clock = QuickClock()
    driven = traverse(rover, clock)
    clock.at = [(200.0, lambda: driven.stop("wanted", quick=quick))]
    return await driven.run()


async def test_it_can_be_stopped_clean() -> None:
    """`stop` without `quick` stops the wheels with the drives' ramp."""
    rover = Rover()
    assert await interrupted(rover, quick=False) == Outcome(Ending.STOPPED, 100.0, "wanted")
    assert rover.told[-2:] == [("speed", 0.0), "disable"]


async def test_it_can_be_stopped_at_once() -> None:
    """`stop` with `quick` quick-stops without waiting for a standstill."""
    rover = Rover()
    assert await interrupted(rover, quick=True) == Outcome(Ending.QUICK_STOPPED, 100.0, "wanted")
    assert rover.told[2:] == ["quick stop", "disable"]


async def test_a_clean_stop_that_does_not_come_becomes_a_quick_one() -> None:
    """Wheels that are measured to turn after the time for a standstill are quick-stopped."""
    rover = Rover(stands=False)
    outcome = await traverse(rover, QuickClock()).run()
    assert outcome.ending is Ending.QUICK_STOPPED
    assert "still turned" in outcome.text
    assert rover.told[-2:] == ["quick stop", "disable"]


async def test_a_quick_stop_overrides_a_clean_one_under_way() -> None:
    """A quick stop overrides a stop with the ramp, and not the reverse."""
    rover, clock = Rover(stands=False), QuickClock()
    driven = traverse(rover, clock)
    clock.at = [(100.0, lambda: driven.stop("gently", quick=False)), (100.0, lambda: driven.stop("now", quick=True))]
    driven.stop("gently", quick=False)
    driven.stop("now", quick=True)
    driven.stop("gently again", quick=False)
    assert (await driven.run()).text == "now"
    assert rover.told[-2:] == ["quick stop", "disable"]


async def test_drives_that_cannot_be_enabled_are_reported_and_nothing_turns() -> None:
    """The traverse fails with the drive's error, and no speed is set."""
    rover = Rover(refuses={"enable": "stays in fault"})
    outcome = await traverse(rover, QuickClock()).run()
    assert outcome.ending is Ending.FAILED
    assert "node 3: stays in fault" in outcome.text
    assert rover.told == ["enable"]


@pytest.mark.parametrize("quick", [True, False])
async def test_one_that_is_stopped_while_the_drives_are_enabled_never_turns(quick: bool) -> None:
    """No speed is set after a stop that came while the drives were being enabled."""
    rover = Rover()
    driven = traverse(rover, QuickClock())
    driven.stop("gone", quick=quick)
    assert (await driven.run()).text == "gone"
    assert rover.told == ["enable", "quick stop" if quick else ("speed", 0.0), "disable"]


async def test_a_drive_that_refuses_ends_in_a_quick_stop() -> None:
    """A drive's error during the traverse ends in a quick stop."""
    rover = Rover(refuses={"speed": "the drive is in fault"})
    outcome = await traverse(rover, QuickClock()).run()
    assert outcome.ending is Ending.QUICK_STOPPED
    assert rover.told[-2:] == ["quick stop", "disable"]


async def test_a_stop_that_is_not_confirmed_is_reported() -> None:
    """A quick stop that is not confirmed ends the traverse as failed, with the error."""
    outcome = await interrupted(Rover(refuses={"quick stop": "does not stop"}), quick=True)
    assert outcome.ending is Ending.FAILED
    assert "does not stop" in outcome.text


async def test_cancelling_it_stops_the_wheels() -> None:
    """Cancellation quick-stops and disables the wheels."""
    rover = Rover()
    task = asyncio.create_task(traverse(rover, Clock()).run())
    await until(lambda: ("speed", plan().wheel_speed_rad_s) in rover.told)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert rover.told[-2:] == ["quick stop", "disable"]
