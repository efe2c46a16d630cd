"""States and transitions of ISA-18.2."""

from __future__ import annotations

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.daemon.ground.alarms.state import Action, Alarm, AlarmState, RefusedError, operated, reported
from regolithd.daemon.messages.alarm import Severity

NOW = 1_000


def report(alarm: Alarm, *, active: bool, severity: Severity = Severity.ERROR, latching: bool = False) -> Alarm:
    """Return the alarm after a message."""
    return reported(alarm, NOW, active=active, severity=severity, latching=latching)[0]


def test_an_alarm_that_ends_before_it_is_acknowledged_stays() -> None:
    """Raised, cleared, acknowledged: unacknowledged, returned to normal unacknowledged, normal."""
    alarm = report(Alarm("bus"), active=True)
    assert alarm.state(NOW) is AlarmState.UNACKNOWLEDGED
    alarm = report(alarm, active=False)
    assert alarm.state(NOW) is AlarmState.RETURNED
    assert operated(alarm, Action.ACKNOWLEDGED, NOW).state(NOW) is AlarmState.NORMAL


def test_an_acknowledged_alarm_ends_by_itself() -> None:
    """Raised, acknowledged, cleared: normal."""
    alarm = operated(report(Alarm("bus"), active=True), Action.ACKNOWLEDGED, NOW)
    assert alarm.state(NOW) is AlarmState.ACKNOWLEDGED
    assert report(alarm, active=False).state(NOW) is AlarmState.NORMAL


@pytest.mark.parametrize("acknowledged_first", [True, False])
def test_a_latching_alarm_needs_acknowledgement_and_reset(*, acknowledged_first: bool) -> None:
    """Whatever comes first, its end or its acknowledgement, only a reset makes it normal."""
    alarm = report(Alarm("soil-change"), active=True, latching=True)
    if acknowledged_first:
        alarm = operated(alarm, Action.ACKNOWLEDGED, NOW)
    alarm = report(alarm, active=False)
    if not acknowledged_first:
        assert alarm.state(NOW) is AlarmState.LATCHED
        with pytest.raises(RefusedError, match="latched-unacknowledged: it cannot be reset"):
            operated(alarm, Action.RESET, NOW)
        alarm = operated(alarm, Action.ACKNOWLEDGED, NOW)
    assert alarm.state(NOW) is AlarmState.LATCHED_ACKNOWLEDGED
    assert operated(alarm, Action.RESET, NOW).state(NOW) is AlarmState.NORMAL


def test_a_worse_alarm_is_unacknowledged_again_and_a_changed_text_is_not() -> None:
    """Only a higher severity annunciates an acknowledged alarm again."""
    alarm = operated(report(Alarm("bus"), active=True, severity=Severity.WARNING), Action.ACKNOWLEDGED, NOW)
    assert report(alarm, active=True, severity=Severity.WARNING).acknowledged
    assert not report(alarm, active=True, severity=Severity.CRITICAL).acknowledged


def test_shelving_ends_by_itself_and_hides_what_happens_meanwhile() -> None:
    """A shelved alarm is shelved until its time, and then has the state of its condition."""
    alarm = operated(report(Alarm("bus"), active=True), Action.SHELVED, NOW, NOW + 10)
    alarm = report(alarm, active=False)
    assert [alarm.state(NOW + after) for after in (0, 9, 10)] == [AlarmState.SHELVED] * 2 + [AlarmState.RETURNED]
    assert operated(alarm, Action.UNSHELVED, NOW).state(NOW) is AlarmState.RETURNED


@pytest.mark.parametrize("action", [Action.ACKNOWLEDGED, Action.RESET, Action.UNSHELVED, Action.SHELVED])
def test_what_the_state_does_not_allow_is_refused(action: Action) -> None:
    """A normal alarm has nothing to acknowledge, to reset or to unshelve, and no shelving lies in the past."""
    with pytest.raises(RefusedError, match="alarm bus is normal"):
        operated(Alarm("bus"), action, NOW)


@given(st.lists(st.tuples(st.booleans(), st.booleans(), st.sampled_from([*Action]))))
def test_no_sequence_loses_an_unacknowledged_alarm(steps: list[tuple[bool, bool, Action]]) -> None:
    """An alarm that was raised is normal again only after an acknowledgement."""
    alarm, waiting = Alarm("bus"), False
    for active, latching, action in steps:
        before = alarm
        alarm = report(alarm, active=active, latching=latching)
        waiting |= active and not before.active
        try:
            alarm = operated(alarm, action, NOW, NOW)
            waiting &= action is not Action.ACKNOWLEDGED
        except RefusedError:
            pass
        assert not (waiting and alarm.state(NOW) is AlarmState.NORMAL)


def test_every_combination_has_a_state() -> None:
    """Each combination of active, acknowledged and latched has one of the states."""
    states = {
        Alarm("a", active=active, acknowledged=acknowledged, latched=latched and not active).state(NOW)
        for active, acknowledged, latched in product([True, False], repeat=3)
    }
    assert states == set(AlarmState) - {AlarmState.SHELVED}
