"""The loop of `regolithd monitor`: rows of a growing recording to the sequential test, its reports to the outside."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.errors import counted
from regolithd.calibration.mismatch.online.channels import monitors_of
from regolithd.calibration.mismatch.online.pieces import Cutter
from regolithd.calibration.mismatch.online.thresholds import ONLINE_THRESHOLDS, OnlineThresholds
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.daemon.mismatch.online.growing import growing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from regolithd.calibration.mismatch.online.pieces import Piece
    from regolithd.calibration.mismatch.online.report import Change, Report
    from regolithd.daemon.mismatch.online.growing import Growing

POLL_S = 1.0
"""Time between two looks at a recording that has not grown (a choice: the daemon writes twice a second)."""


@dataclass(frozen=True, slots=True)
class Told:
    """What is known of all channels after an interval.

    Attributes
    ----------
    recording: the file that is read now
    reports: by channel
    notes: rows that came too late, a clock that was set back
    """

    recording: str
    reports: Mapping[str, Report]
    notes: tuple[str, ...]

    @property
    def changes(self) -> tuple[Change, ...]:
        """The changes of all channels."""
        return tuple(change for report in self.reports.values() for change in report.changes)

    @property
    def time_s(self) -> float:
        """The end of the interval, from the recording's start."""
        return next(iter(self.reports.values())).time_s

    def to_json(self) -> dict[str, Any]:
        """Return the object of one line."""
        channels = {channel: report.to_json() for channel, report in self.reports.items()}
        return {"recording": self.recording, "time_s": self.time_s, "channels": channels, "notes": list(self.notes)}


def monitored(
    recording: Path,
    simulation: Path,
    *,
    follow: bool,
    announce: Callable[[str], None],
    sleep: Callable[[float], None] = time.sleep,
    thresholds: OnlineThresholds = ONLINE_THRESHOLDS,
) -> Iterator[Told]:
    """Yield what is known after each interval of a recording.

    Parameters
    ----------
    recording: a file, or the folder of a running daemon
    follow: whether to wait for more, until the file is closed; else what is there is read, and its rest is a last piece
    announce: called with what is damaged and left out, and before code of SIM.toml is run
    sleep: waits for so many seconds

    Raises
    ------
    MismatchError
        When recording or simulation cannot be used.
    """
    simulated = load_simulation(simulation, announce=announce)
    source = growing(recording, simulated.wheel_column, announce)
    cutter = Cutter(thresholds.interval_s, simulated.wheel_column)
    monitors = monitors_of(simulated, thresholds)
    for piece in _pieces(source, cutter, follow=follow, sleep=sleep):
        reports = {channel: monitor.add(piece) for channel, monitor in monitors.items()}
        yield Told(source.name, reports, _notes(cutter))


def _pieces(source: Growing, cutter: Cutter, *, follow: bool, sleep: Callable[[float], None]) -> Iterator[Piece]:
    while True:
        for rows in source.read():
            yield from cutter.add(rows)
        if source.ended or not follow:
            yield from cutter.rest()
            return
        sleep(POLL_S)


def _notes(cutter: Cutter) -> tuple[str, ...]:
    notes = []
    if cutter.late_rows:
        notes.append(f"{cutter.late_rows} rows came after their interval was decided on; they are left out.")
    if cutter.clock_set_back:
        notes.append(
            f"The clock was set back {counted(cutter.clock_set_back, 'time')}; time goes on from the next interval."
        )
    return tuple(notes)


def line_of(told: Told) -> str:
    """Return one line of JSON."""
    return json.dumps(told.to_json(), ensure_ascii=False)


def lines_of(told: Told, before: frozenset[tuple[str, str]]) -> list[str]:
    """Return the lines for the terminal: what is new, what was withdrawn, and why an interval was not compared."""
    at = f"{told.time_s / 60:7.1f} min  "
    now = identities(told)
    return [
        *(f"{at}{name}: not compared: {each.not_compared}" for name, each in told.reports.items() if each.not_compared),
        *(
            f"{at}{channel}: {change.name}: {change.statement}"
            for channel, report in told.reports.items()
            for change in report.changes
            if identity(channel, change) not in before
        ),
        *(f"{at}{channel}: withdrawn: {name}" for channel, name in sorted(before - now)),
    ]


def identity(channel: str, change: Change) -> tuple[str, str]:
    """Return what makes a change another one: its channel, name and wheels."""
    return channel, f"{change.name} on {', '.join(map(str, change.wheels))}"


def identities(told: Told) -> frozenset[tuple[str, str]]:
    """Return those of all changes."""
    return frozenset(identity(channel, change) for channel, report in told.reports.items() for change in report.changes)
