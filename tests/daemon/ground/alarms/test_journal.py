"""The journal of alarms: what is shown, who did it, and that it is the same after a restart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from ground_messages import START_NS, received

from regolithd.daemon.ground.alarms.journal import AlarmJournal
from regolithd.daemon.ground.alarms.state import Action, AlarmState, RefusedError

if TYPE_CHECKING:
    import sqlite3

    from regolithd.daemon.ground.received import Received

SECOND = 1_000_000_000


def alarm(
    sequence: int, *, active: bool, name: str = "bus", severity: str = "error", text: str = "bus-off"
) -> Received:
    """Return an alarm message, a second after the one before it."""
    return received(f"alarm/{name}", sequence, sequence, name=name, active=active, severity=severity, text=text)


def test_a_journal_is_the_same_after_a_restart(writer: sqlite3.Connection) -> None:
    """States, names and times are computed from the stored entries; the newest message again adds nothing."""
    journal = AlarmJournal(writer)
    now_ns = START_NS + 10 * SECOND
    journal.report(alarm(1, active=True))
    journal.report(alarm(2, active=True, name="clock", severity="warning"))
    journal.operate("kapvik", "bus", Action.ACKNOWLEDGED, "Ada", now_ns)
    journal.operate("kapvik", "clock", Action.SHELVED, "Bob", now_ns, until_ns=now_ns + 60 * SECOND)
    journal.report(alarm(3, active=False))
    again = AlarmJournal(writer)
    assert not again.report(alarm(2, active=True, name="clock", severity="warning"))
    assert again.reports("kapvik", now_ns) == journal.reports("kapvik", now_ns)
    (clock,) = again.reports("kapvik", now_ns)
    assert (clock.name, clock.state, clock.shelved_by) == ("clock", AlarmState.SHELVED, "Bob")
    (clock,) = again.reports("kapvik", now_ns + 61 * SECOND)
    assert clock.state is AlarmState.UNACKNOWLEDGED
    entries = AlarmJournal.entries(writer, "kapvik", 10)
    assert [(name, entry.action.value, entry.who) for name, entry in entries][:2] == [
        ("clock", "shelved", "Bob"),
        ("bus", "acknowledged", "Ada"),
    ]


def test_alarms_that_need_attention_come_first(writer: sqlite3.Connection) -> None:
    """Unacknowledged before acknowledged, critical before warning; alarms that are normal are not listed."""
    journal = AlarmJournal(writer)
    for sequence, (name, severity) in enumerate([("clock", "warning"), ("bus", "critical"), ("store", "error")]):
        journal.report(alarm(sequence, active=True, name=name, severity=severity))
    journal.report(alarm(9, active=False, name="kernel"))
    journal.operate("kapvik", "bus", Action.ACKNOWLEDGED, "Ada", START_NS)
    assert [each.name for each in journal.reports("kapvik", START_NS)] == ["store", "clock", "bus"]


def test_a_new_occurrence_needs_a_new_acknowledgement(writer: sqlite3.Connection) -> None:
    """After an end and a new beginning the earlier acknowledgement is not shown."""
    journal = AlarmJournal(writer)
    journal.report(alarm(1, active=True))
    journal.operate("kapvik", "bus", Action.ACKNOWLEDGED, "Ada", START_NS + 2 * SECOND)
    journal.report(alarm(3, active=False))
    journal.report(alarm(4, active=True))
    (shown,) = journal.reports("kapvik", START_NS)
    assert (shown.state, shown.acknowledged_by) == (AlarmState.UNACKNOWLEDGED, "")


def test_actions_on_nothing_and_shelving_for_days_are_refused(writer: sqlite3.Connection) -> None:
    """The message says what is wrong, and nothing is stored."""
    journal = AlarmJournal(writer)
    with pytest.raises(RefusedError, match="rover kapvik has no alarm bus"):
        journal.operate("kapvik", "bus", Action.ACKNOWLEDGED, "Ada", START_NS)
    journal.report(alarm(1, active=True))
    with pytest.raises(RefusedError, match="at most 8 hours"):
        journal.operate("kapvik", "bus", Action.SHELVED, "Ada", START_NS, until_ns=START_NS + 86_400 * SECOND)
    assert len(AlarmJournal.entries(writer, "kapvik", 10)) == 1


def test_an_alarm_of_an_unknown_kind_does_not_end_the_ground(writer: sqlite3.Connection) -> None:
    """A newer daemon may have a severity that is unknown here, and fields that are; the latter are ignored."""
    journal = AlarmJournal(writer)
    assert not journal.report(received("alarm/x", 1, name="x", active=True, severity="catastrophic"))
    assert journal.report(received("alarm/x", 2, name="x", active=True, severity="error", colour="red"))


def test_an_entry_of_an_earlier_version_has_the_least(writer: sqlite3.Connection) -> None:
    """What it did not know yet is empty: such an alarm latches nothing, and is a warning."""
    writer.execute(
        "INSERT INTO alarm_entry VALUES (NULL, 'kapvik', 'bus', ?, ?)",
        (START_NS, f'{{"time_ns": {START_NS}, "action": "raised"}}'),
    )
    journal = AlarmJournal(writer)
    (report,) = journal.reports("kapvik", START_NS)
    assert (report.name, report.state, report.active) == ("bus", AlarmState.UNACKNOWLEDGED, True)
    assert (report.severity, report.latching, report.text, report.remedy, report.evidence) == (
        "warning",
        False,
        "",
        "",
        None,
    )
    ((_, entry),) = journal.entries(writer, "kapvik", 10)
    assert (entry.who, entry.comment, entry.until_ns, entry.latching) == ("", "", 0, False)
