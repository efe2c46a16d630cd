"""The journal tells what is wrong: alarms at their severity, events that no alarm says, each change once."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import pytest

from regolithd.daemon.health.alarm_log import NUMBERS_PAUSE_S, AlarmLog
from regolithd.daemon.health.alarms import Alarm
from regolithd.daemon.messages.alarm import Severity
from regolithd.drivers.canopen.emcy import Emergency
from regolithd.drivers.master.boot_error import BootReason
from regolithd.drivers.master.events import (
    Identity,
    MotionStopped,
    NodeBooted,
    NodeBootFailed,
    NodeEmergency,
    NodeLost,
    NodeReturned,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.drivers.master.events import NetworkEvent

Lines = list[tuple[str, str]]


@pytest.fixture
def lines(caplog: pytest.LogCaptureFixture) -> Callable[[], Lines]:
    """Return the level and the text of each line at INFO or above since the last call."""
    caplog.set_level(logging.INFO, "regolithd")

    def taken() -> Lines:
        found = [(record.levelname, record.getMessage()) for record in caplog.records]
        caplog.clear()
        return found

    return taken


@pytest.mark.parametrize(
    ("severity", "level"),
    [(Severity.WARNING, "WARNING"), (Severity.ERROR, "ERROR"), (Severity.CRITICAL, "CRITICAL")],
)
def test_an_alarm_is_logged_when_it_begins_and_ends(severity: Severity, level: str, lines: Callable[[], Lines]) -> None:
    """With its text and what to do; of one that was never active nothing is said."""
    log = AlarmLog()
    log.alarm("node-3", None)
    log.alarm("node-3", Alarm("node-3", severity, "node 3 is lost", "Check its power."))
    log.alarm("node-3", None)
    log.alarm("node-3", None)
    assert lines() == [
        (level, "alarm node-3: node 3 is lost. Check its power."),
        ("INFO", "alarm node-3: has ended"),
    ]


def test_a_text_that_changes_is_logged_and_a_count_that_rises_once_a_minute(lines: Callable[[], Lines]) -> None:
    """A count may rise with each frame, and would fill the journal."""
    now_ns = 0
    log = AlarmLog(lambda: now_ns)

    def raised(text: str, severity: Severity = Severity.ERROR) -> list[str]:
        log.alarm("store", Alarm("store", severity, text, "Free space."))
        return [text for _, text in lines()]

    assert raised("1 messages were lost") == ["alarm store: 1 messages were lost. Free space."]
    now_ns = int(NUMBERS_PAUSE_S * 1e9) - 1
    assert raised("2 messages were lost") == []
    now_ns += 1
    assert raised("3 messages were lost") == ["alarm store: 3 messages were lost. Free space."]
    assert raised("the disk refused 4 messages") == ["alarm store: the disk refused 4 messages. Free space."]
    assert raised("the disk refused 4 messages", Severity.CRITICAL) != []
    log.alarm("store", None)
    assert lines() == [("INFO", "alarm store: has ended")]
    assert raised("the disk refused 4 messages", Severity.CRITICAL) != []


@pytest.mark.parametrize("text", ["no answer", "no answer.", "no answer. Is it powered?"])
def test_a_sentence_ends_once(text: str, lines: Callable[[], Lines]) -> None:
    """Texts of alarms end with and without a full stop."""
    AlarmLog().alarm("bus", Alarm("bus", Severity.ERROR, text, "Look."))
    assert lines() == [("ERROR", f"alarm bus: {text.rstrip('.')}{'' if text.endswith('?') else '.'} Look.")]


def emergency(code: int) -> NodeEmergency:
    """An EMCY message of node 3."""
    return NodeEmergency(0, 3, Emergency(0, 3, code, 0, b"\0" * 5, "EMCY"), "node 3: EMCY")


@pytest.mark.parametrize(
    ("event", "expected"),
    [
        (NodeBooted(0, 3, Identity(0, 0, 0, 0, 0), "node 3 is operational"), ("INFO", "node 3 is operational")),
        (NodeReturned(0, 3, "node 3 sends again"), ("INFO", "node 3 sends again")),
        (MotionStopped(0, 3, "motion stopped"), ("WARNING", "motion stopped")),
        (emergency(0x2310), ("WARNING", "node 3: EMCY")),
        (emergency(0), ("INFO", "node 3: EMCY")),
        (NodeLost(0, 3, "node 3 lost"), None),
        (NodeBootFailed(0, 3, BootReason.NO_SDO_ANSWER, "node 3: no answer", ""), None),
    ],
)
def test_an_event_is_logged_where_no_alarm_says_it(
    event: NetworkEvent, expected: tuple[str, str] | None, lines: Callable[[], Lines]
) -> None:
    """A node that is lost or fails to boot has an alarm."""
    log = AlarmLog()
    log.event(event, 0)
    assert lines() == ([expected] if expected else [])
    log.event(event, 7)
    assert lines() == ([(expected[0], f"{expected[1]} (7 more like it before)")] if expected else [])
