"""The `alarm/…` message: a condition that needs attention, and its severity."""

from __future__ import annotations

from enum import StrEnum

from regolithd.daemon.messages.header import Header, Time


class Severity(StrEnum):
    """Severity of an alarm."""

    WARNING = "warning"  # data are less accurate
    ERROR = "error"  # data are missing
    CRITICAL = "critical"  # the rover must not move


class AlarmMessage(Header):
    """A condition that needs attention begins (`active`) or ends. Retained: a new subscriber gets the current one."""

    name: str
    active: bool
    severity: Severity
    since: Time
    text: str
    remedy: str
