"""The journal of alarms: every report of a rover and every action of an operator, stored; the states follow from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, ValidationError

from regolithd.daemon.ground.alarms.state import Action, Alarm, AlarmState, RefusedError, operated, reported
from regolithd.daemon.messages.alarm import Severity, SoilChangeEvidence
from regolithd.daemon.messages.header import iso_time

if TYPE_CHECKING:
    import sqlite3

    from regolithd.daemon.ground.received import Received

LONGEST_SHELVING_S = 8 * 3600
"""ISA-18.2 asks for a limit: what is shelved comes back by itself."""
_ORDER = tuple(AlarmState)


class Entry(BaseModel):
    """A line of the journal. `who` is an operator's name, or empty where the rover reported."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    time_ns: int
    action: Action
    who: str = ""
    comment: str = ""
    until_ns: int = 0
    severity: Severity = Severity.WARNING
    latching: bool = False
    text: str = ""
    remedy: str = ""
    evidence: SoilChangeEvidence | None = None


class AlarmReport(BaseModel):
    """An alarm as the page shows it."""

    model_config = ConfigDict(frozen=True)

    name: str
    state: AlarmState
    active: bool
    severity: Severity
    text: str
    remedy: str
    evidence: SoilChangeEvidence | None
    raised: str | None
    cleared: str | None
    acknowledged: str | None
    """When it was acknowledged since it was last raised, and by whom."""
    acknowledged_by: str
    shelved_until: str | None
    shelved_by: str
    latching: bool


class _Content(BaseModel):
    """The fields of an alarm message that are used; those of a newer daemon are ignored."""

    model_config = ConfigDict(extra="ignore")

    active: bool
    severity: Severity
    text: str = ""
    remedy: str = ""
    latching: bool = False
    evidence: SoilChangeEvidence | None = None


class AlarmJournal:
    """The alarms of all rovers; the one writer of their table."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._alarms: dict[tuple[str, str], Alarm] = {}
        self._entries: dict[tuple[str, str], dict[Action, Entry]] = {}
        for rover, name, entry in connection.execute("SELECT rover, name, entry FROM alarm_entry ORDER BY id"):
            self._apply(rover, name, Entry.model_validate_json(entry))

    def report(self, message: Received) -> bool:
        """Take a message of a topic `alarm/NAME`; return whether anything changed."""
        name = message.topic.partition("/")[2]
        try:
            content = _Content.model_validate(message.content)
        except ValidationError:
            return False  # an alarm of a newer daemon, whose severity is unknown here, say
        alarm = self._alarms.get((message.rover, name), Alarm(name))
        _, action = reported(
            alarm, message.time_ns, active=content.active, severity=content.severity, latching=content.latching
        )
        if action is None:
            return False
        fields = content.model_dump(exclude={"active"})
        entry = Entry(time_ns=message.time_ns, action=action, **fields)
        if action is Action.CHANGED and self._is_known(message.rover, name, entry):
            return False
        self._append(message.rover, name, entry)
        return True

    def _is_known(self, rover: str, name: str, entry: Entry) -> bool:
        """Return whether the last report was the same, as after a restart of the ground."""
        last = _last_report(self._entries[rover, name])
        return last.model_copy(update={"time_ns": entry.time_ns, "action": entry.action}) == entry

    def operate(self, rover: str, name: str, action: Action, who: str, now_ns: int, **details: object) -> None:
        """Take an operator's action, with `until_ns` and `comment` for shelving.

        Raises
        ------
        RefusedError
            There is no such alarm, or its state does not allow the action.
        """
        if (rover, name) not in self._alarms:
            raise RefusedError(f"rover {rover} has no alarm {name}")
        entry = Entry.model_validate({"time_ns": now_ns, "action": action, "who": who, **details})
        if entry.until_ns > now_ns + LONGEST_SHELVING_S * 1_000_000_000:
            raise RefusedError(f"an alarm is shelved for at most {LONGEST_SHELVING_S // 3600} hours")
        operated(self._alarms[rover, name], action, now_ns, entry.until_ns)
        self._append(rover, name, entry)

    def _append(self, rover: str, name: str, entry: Entry) -> None:
        self._connection.execute(
            "INSERT INTO alarm_entry VALUES (NULL, ?, ?, ?, ?)", (rover, name, entry.time_ns, entry.model_dump_json())
        )
        self._apply(rover, name, entry)

    def _apply(self, rover: str, name: str, entry: Entry) -> None:
        alarm = self._alarms.get((rover, name), Alarm(name))
        if entry.who:
            try:
                alarm = operated(alarm, entry.action, entry.time_ns, entry.until_ns)
            except RefusedError:
                return  # the clock of the ground was set back
        else:
            active = entry.action is not Action.CLEARED
            alarm, _ = reported(alarm, entry.time_ns, active=active, severity=entry.severity, latching=entry.latching)
        self._alarms[rover, name] = alarm
        entries = self._entries.setdefault((rover, name), {})
        if entry.action is Action.RAISED:
            entries.clear()
        entries[entry.action] = entry

    def reports(self, rover: str, now_ns: int) -> list[AlarmReport]:
        """Return the alarms that are not normal: by state, severity and time, those that need attention first."""
        found = [
            self._report(alarm, self._entries[at, name], now_ns)
            for (at, name), alarm in self._alarms.items()
            if at == rover and alarm.state(now_ns) is not AlarmState.NORMAL
        ]
        severities = tuple(Severity)[::-1]
        return sorted(found, key=lambda each: (_ORDER.index(each.state), severities.index(each.severity), each.name))

    @staticmethod
    def _report(alarm: Alarm, entries: dict[Action, Entry], now_ns: int) -> AlarmReport:
        told = _last_report(entries)
        acknowledged, shelved = entries.get(Action.ACKNOWLEDGED), entries.get(Action.SHELVED)
        state = alarm.state(now_ns)
        if not alarm.acknowledged:
            acknowledged = None
        return AlarmReport(
            name=alarm.name,
            state=state,
            active=alarm.active,
            severity=alarm.severity,
            text=told.text,
            remedy=told.remedy,
            evidence=told.evidence,
            raised=_time(alarm.raised_ns),
            cleared=None if alarm.active else _time(alarm.cleared_ns),
            acknowledged=_time(acknowledged.time_ns) if acknowledged else None,
            acknowledged_by=acknowledged.who if acknowledged else "",
            shelved_until=_time(alarm.shelved_until_ns) if state is AlarmState.SHELVED else None,
            shelved_by=shelved.who if shelved and state is AlarmState.SHELVED else "",
            latching=alarm.latching,
        )

    @staticmethod
    def entries(connection: sqlite3.Connection, rover: str, count: int) -> list[tuple[str, Entry]]:
        """Return the newest entries of a rover with the names of their alarms, newest first."""
        rows = connection.execute(
            "SELECT name, entry FROM alarm_entry WHERE rover = ? ORDER BY time_ns DESC, id DESC LIMIT ?", (rover, count)
        )
        return [(name, Entry.model_validate_json(entry)) for name, entry in rows]


def _last_report(entries: dict[Action, Entry]) -> Entry:
    """Return the newest entry that the rover made."""
    reports = (entries[each] for each in (Action.RAISED, Action.CHANGED, Action.CLEARED) if each in entries)
    return max(reports, key=lambda entry: entry.time_ns)


def _time(time_ns: int) -> str | None:
    return iso_time(time_ns) if time_ns else None
