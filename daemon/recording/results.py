"""Everything that was measured and estimated, as arrays over time and wheel, from the MCAP files of a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.daemon.pipeline.snapshot import BODY_QUANTITIES, WHEEL_QUANTITIES, WHEELS
from regolithd.daemon.recording.content import ESTIMATE, ESTIMATED, SNAPSHOT, as_written_today, six
from regolithd.daemon.recording.mcap_file import open_mcap, read_messages

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path

Array = NDArray[np.float64]

OUTSIDE = "outside_training_range"
POSTERIOR = ("cohesion_Pa", "friction_angle_rad", "drawbar_margin")
LEVELS = ("mean", "low_90", "low_50", "median", "high_50", "high_90")
ALARM = ("soil_change", "soil_change_torque_ratio", "soil_change_onset_s")
"""1 at the instant of an alarm and 0 otherwise; torque ratio, and seconds from the onset to the alarm."""


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """A recording's results; NaN where there is no value.

    Attributes
    ----------
    time_ns
        Shape (time,): CLOCK_REALTIME of each SYNC.
    of_wheels
        Name → shape (time, 6).
    of_rover
        Name → shape (time,): the body's quantities, the posterior (only where a half second ended), the alarm.
    """

    time_ns: NDArray[np.int64]
    of_wheels: dict[str, Array]
    of_rover: dict[str, Array]


@dataclass(frozen=True, slots=True)
class _Instant:
    time_ns: int
    measured: dict[str, Any]
    estimated: dict[str, Any]


def read_results(
    recordings: Iterable[Path],
    opening: Callable[[Path], AbstractContextManager[IO[bytes]]] = open_mcap,
    on_gap: Callable[[str], None] | None = None,
) -> Results:
    """Read MCAP files in their order; `on_gap` and errors are those of `read_messages`."""
    instants = list(_instants(recordings, opening, on_gap))
    of_wheels = {
        each.name: _of_wheels(each.name, [instant.measured for instant in instants])
        for each in WHEEL_QUANTITIES
        if not each.flags
    }
    estimated = [instant.estimated for instant in instants]
    of_wheels |= {name: _of_wheels(name, estimated) for name in (*ESTIMATED, "valid")}
    outside = [{name: bool(each[name]) for name in six(OUTSIDE) if name in each} for each in estimated]
    of_wheels[OUTSIDE] = _of_wheels(OUTSIDE, outside)
    of_rover = {
        each.name: np.array([instant.measured.get(each.name) for instant in instants], np.float64)
        for each in BODY_QUANTITIES
    }
    of_rover |= _posterior(instants) | _alarm(instants)
    return Results(np.array([instant.time_ns for instant in instants], np.int64), of_wheels, of_rover)


def _instants(
    recordings: Iterable[Path],
    opening: Callable[[Path], AbstractContextManager[IO[bytes]]],
    on_gap: Callable[[str], None] | None,
) -> Iterator[_Instant]:
    """Yield each snapshot with its estimate, which follows it in the file."""
    for recording in recordings:
        measured: dict[str, Any] | None = None
        for message in read_messages(recording, opening, on_gap):
            if message.topic == SNAPSHOT:
                if measured is not None:
                    yield _Instant(measured["time_ns"], measured, {})
                measured = as_written_today(message.content)
            elif message.topic == ESTIMATE and measured is not None:
                yield _Instant(measured["time_ns"], measured, as_written_today(message.content))
                measured = None
        if measured is not None:
            yield _Instant(measured["time_ns"], measured, {})


def _of_wheels(name: str, messages: list[dict[str, Any]]) -> Array:
    """Return shape (time, 6); NaN where a message has no value."""
    names = six(name)
    return np.array([[message.get(each) for each in names] for message in messages], np.float64).reshape(-1, WHEELS)


def _posterior(instants: list[_Instant]) -> dict[str, Array]:
    found = {}
    for quantity in POSTERIOR:
        for level in LEVELS:
            values = [(instant.estimated.get("posterior") or {}).get(quantity, {}).get(level) for instant in instants]
            found[f"posterior_{quantity}_{level}"] = np.array(values, np.float64)
    return found


def _alarm(instants: list[_Instant]) -> dict[str, Array]:
    alarms = [(instant.estimated.get("soil_change") or {}).get("alarm") for instant in instants]
    ratio = [alarm and alarm["torque_ratio"] for alarm in alarms]
    onset = [alarm and (alarm["time_ns"] - alarm["onset_ns"]) / 1e9 for alarm in alarms]
    values = ([float(alarm is not None) for alarm in alarms], ratio, onset)
    return {name: np.array(column, np.float64) for name, column in zip(ALARM, values, strict=True)}
