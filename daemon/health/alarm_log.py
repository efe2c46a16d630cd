"""Writes events and alarms to the log, so that the journal tells what is wrong where no broker is there to tell it.

| what | level |
|---|---|
| an alarm begins, or its text changes: the text and what to do | its severity |
| an alarm ends | INFO |
| a text that differs from the last one only by its numbers, within `NUMBERS_PAUSE_S` | DEBUG |
| an EMCY message; the network stopped the wheels | WARNING |
| a node has booted, or sends again; an EMCY message that ends an error | INFO |
| other events: an alarm says them as well, or they are routine | DEBUG |
"""

from __future__ import annotations

import logging
import re
import time
from typing import TYPE_CHECKING

from regolithd.daemon.messages.alarm import Severity
from regolithd.drivers.master.events import MotionStopped, NodeBooted, NodeEmergency, NodeReturned

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.daemon.health.alarms import Alarm
    from regolithd.drivers.master.events import NetworkEvent

NUMBERS_PAUSE_S = 60.0
"""A count that rises is logged again after this time at the earliest."""
_OF_SEVERITY = {
    Severity.WARNING: logging.WARNING,
    Severity.ERROR: logging.ERROR,
    Severity.CRITICAL: logging.CRITICAL,
}
_OF_EVENT: dict[type[NetworkEvent], int] = {
    NodeEmergency: logging.WARNING,
    MotionStopped: logging.WARNING,
    NodeBooted: logging.INFO,
    NodeReturned: logging.INFO,
}

_log = logging.getLogger(__name__)
# `run` sets logging up; a program that does not, `demo`, has a screen of its own.
_log.addHandler(logging.NullHandler())


class AlarmLog:
    """Logs events, and the changes of alarms."""

    def __init__(self, monotonic_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._monotonic_ns = monotonic_ns
        self._told: dict[str, tuple[str, int]] = {}

    def event(self, event: NetworkEvent, suppressed: int) -> None:
        """Log an event that is published, with the number of those before it that are not."""
        level = _OF_EVENT.get(type(event), logging.DEBUG)
        if isinstance(event, NodeEmergency) and event.emergency.cleared:
            level = logging.INFO
        others = f" ({suppressed} more like it before)" if suppressed else ""
        _log.log(level, "%s%s", event.text, others)

    def alarm(self, name: str, alarm: Alarm | None) -> None:
        """Log that an alarm is active with this text, or, with None, that it has ended, if it was logged before."""
        told = self._told.get(name)
        if alarm is None:
            if self._told.pop(name, None):
                _log.info("alarm %s: has ended", name)
            return
        now, text = self._monotonic_ns(), f"{alarm.severity} {alarm.text}"
        if told and _without_numbers(told[0]) == _without_numbers(text) and now - told[1] < NUMBERS_PAUSE_S * 1e9:
            level = logging.DEBUG
        else:
            level, self._told[name] = _OF_SEVERITY[alarm.severity], (text, now)
        end = "" if alarm.text.endswith((".", "?")) else "."
        _log.log(level, "alarm %s: %s%s %s", name, alarm.text, end, alarm.remedy)


def _without_numbers(text: str) -> str:
    return re.sub(r"\d+", "0", text)
