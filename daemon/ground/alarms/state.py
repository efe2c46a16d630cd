"""The states of an alarm, as ISA-18.2 (IEC 62682) defines them, and the transitions between them.

| state | active | acknowledged | ISA-18.2 |
|---|---|---|---|
| unacknowledged | yes | no | unacknowledged alarm |
| acknowledged | yes | yes | acknowledged alarm |
| returned-unacknowledged | no | no | returned to normal, unacknowledged |
| latched-unacknowledged | no | no | latched, unacknowledged: a latching alarm that has ended |
| latched-acknowledged | no | yes | latched, acknowledged: waits for its reset |
| shelved | any | any | shelved: hidden by an operator until a time |
| normal | no | yes | normal |

    raised ─▶ unacknowledged ─acknowledge─▶ acknowledged ─cleared─▶ normal, or latched-acknowledged ─reset─▶ normal
                   └─cleared─▶ returned-unacknowledged, or latched-unacknowledged ─acknowledge─▶ …

A raised alarm that becomes more severe is unacknowledged again. An acknowledgement is known to this ground only:
nothing is sent to the rover.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from regolithd.daemon.messages.alarm import Severity

RANK = {Severity.WARNING: 1, Severity.ERROR: 2, Severity.CRITICAL: 3}


class AlarmState(StrEnum):
    """State of an alarm (table above)."""

    UNACKNOWLEDGED = "unacknowledged"
    ACKNOWLEDGED = "acknowledged"
    RETURNED = "returned-unacknowledged"
    LATCHED = "latched-unacknowledged"
    LATCHED_ACKNOWLEDGED = "latched-acknowledged"
    SHELVED = "shelved"
    NORMAL = "normal"


class Action(StrEnum):
    """What happened to an alarm: the first three by the rover, the others by an operator."""

    RAISED = "raised"
    CHANGED = "changed"
    CLEARED = "cleared"
    ACKNOWLEDGED = "acknowledged"
    SHELVED = "shelved"
    UNSHELVED = "unshelved"
    RESET = "reset"


OPERATOR_ACTIONS = frozenset({Action.ACKNOWLEDGED, Action.SHELVED, Action.UNSHELVED, Action.RESET})


@dataclass(frozen=True, slots=True)
class Alarm:
    """One alarm of a rover: what its messages and its operators made of it."""

    name: str
    active: bool = False
    acknowledged: bool = True
    latching: bool = False
    latched: bool = False
    shelved_until_ns: int = 0
    severity: Severity = Severity.WARNING
    raised_ns: int = 0
    cleared_ns: int = 0

    def state(self, now_ns: int) -> AlarmState:
        """Return the state at a time."""
        if now_ns < self.shelved_until_ns:
            return AlarmState.SHELVED
        if self.active:
            return AlarmState.ACKNOWLEDGED if self.acknowledged else AlarmState.UNACKNOWLEDGED
        if self.latched:
            return AlarmState.LATCHED_ACKNOWLEDGED if self.acknowledged else AlarmState.LATCHED
        return AlarmState.NORMAL if self.acknowledged else AlarmState.RETURNED


def reported(
    alarm: Alarm, time_ns: int, *, active: bool, severity: Severity, latching: bool
) -> tuple[Alarm, Action | None]:
    """Return the alarm after a message of the rover, and what happened; None if nothing did."""
    if not active:
        if not alarm.active:
            return alarm, None
        return replace(alarm, active=False, cleared_ns=time_ns, latched=alarm.latching), Action.CLEARED
    told = replace(alarm, active=True, severity=severity, latching=latching)
    if not alarm.active:
        return replace(told, acknowledged=False, latched=False, raised_ns=time_ns), Action.RAISED
    worse = RANK[severity] > RANK[alarm.severity]
    return replace(told, acknowledged=alarm.acknowledged and not worse), Action.CHANGED


class RefusedError(ValueError):
    """An action that the state of the alarm does not allow."""


def operated(alarm: Alarm, action: Action, now_ns: int, until_ns: int = 0) -> Alarm:
    """Return the alarm after an operator's action.

    Raises
    ------
    RefusedError
        There is nothing to acknowledge, to reset or to unshelve.
    """
    match action:
        case Action.ACKNOWLEDGED if not alarm.acknowledged:
            return replace(alarm, acknowledged=True)
        case Action.RESET if alarm.latched and alarm.acknowledged:
            return replace(alarm, latched=False)
        case Action.SHELVED if now_ns < until_ns:
            return replace(alarm, shelved_until_ns=until_ns)
        case Action.UNSHELVED if now_ns < alarm.shelved_until_ns:
            return replace(alarm, shelved_until_ns=0)
    raise RefusedError(f"alarm {alarm.name} is {alarm.state(now_ns).value}: it cannot be {action.value}")
