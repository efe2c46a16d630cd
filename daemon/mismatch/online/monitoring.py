"""The loop of `regolithd monitor`: rows of a growing recording to the sequential test, its reports to the outside."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.errors import counted
from regolithd.calibration.mismatch.inference.statements import capital
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
    wheel_column: the column that tells wheels apart
    """

    recording: str
    reports: Mapping[str, Report]
    notes: tuple[str, ...]
    wheel_column: str = "wheel"

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
        return {"recording": self.recording, "time_s": self.time_s, "channels": channels, "notes": self._all_notes()}

    def _all_notes(self) -> list[str]:
        return [*self.notes, *(f"{capital(text)}." for _, text in _lasting(self))]


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
        yield Told(source.name, reports, _notes(cutter), simulated.wheel_column)


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


def lines_of(told: Told, before: Told | None) -> list[str]:
    """Return the lines for the terminal: what is new, what was withdrawn, and what is not compared and why."""
    at = f"{told.time_s / 60:7.1f} min  "
    known, now = identities(before), identities(told)
    left_out, left_out_before = _lasting(told), _lasting(before)
    return [
        *(f"{at}{name}: not compared: {each.not_compared}" for name, each in told.reports.items() if each.not_compared),
        *(f"{at}{channel}: {text}" for channel, text in left_out if (channel, text) not in left_out_before),
        *(f"{at}{channel}: over: {text}" for channel, text in left_out_before if (channel, text) not in left_out),
        *(
            f"{at}{channel}: {change.name}: {change.statement}"
            for channel, report in told.reports.items()
            for change in report.changes
            if identity(channel, change) not in known
        ),
        *(f"{at}{channel}: withdrawn: {name}" for channel, name in sorted(known - now)),
    ]


def _lasting(told: Told | None) -> list[tuple[str, str]]:
    """Return the channel and the words of each wheel that is not compared for longer."""
    reports = told.reports.items() if told else ()
    return [
        (channel, each.statement(told.wheel_column))
        for channel, report in reports
        for each in report.left_out_readings
        if told and each.since_s is not None
    ]


def identity(channel: str, change: Change) -> tuple[str, str]:
    """Return what makes a change another one: its channel, name and wheels."""
    return channel, f"{change.name} on {', '.join(map(str, change.wheels))}"


def identities(told: Told | None) -> frozenset[tuple[str, str]]:
    """Return those of all changes; none of None."""
    reports = told.reports.items() if told else ()
    return frozenset(identity(channel, change) for channel, report in reports for change in report.changes)
