"""The drive's power state machine (CiA 402-2, clause 6), in the master: a pure function from statusword to controlword.

    not ready ──▶ switch-on disabled ──2──▶ ready to switch on ──3──▶ switched on ──4──▶ operation enabled
                         ▲                                                                    │11
                         ├───────────────────────12────────────────────── quick stop active ◀─┘
                         └──15── fault ◀── fault reaction active ◀── any

    transition                      controlword bits 7 3 2 1 0
     2, 6, 8  shutdown                              0 x 1 1 0
     3        switch on                             0 0 1 1 1
     4        enable operation                      0 1 1 1 1
     5        disable operation                     0 0 1 1 1
     7, 9, 12 disable voltage                       0 x x 0 x
    11        quick stop                            0 x 0 1 x
    15        fault reset                        0→1  x x x x     a rising edge: bit 7 must have been 0 before

Quick stop is active low: bit 2 must be 1 for the drive to run.
"""

from __future__ import annotations

from enum import IntEnum, StrEnum


class DriveState(StrEnum):
    """State of the power drive system, from the statusword (0x6041)."""

    NOT_READY = "not-ready-to-switch-on"
    SWITCH_ON_DISABLED = "switch-on-disabled"
    READY = "ready-to-switch-on"
    SWITCHED_ON = "switched-on"
    ENABLED = "operation-enabled"
    QUICK_STOP = "quick-stop-active"
    FAULT_REACTION = "fault-reaction-active"
    FAULT = "fault"
    UNKNOWN = "unknown"


class Controlword(IntEnum):
    """Values of the controlword (0x6040); only the last one sets bit 7 (fault reset)."""

    DISABLE_VOLTAGE = 0x0000
    QUICK_STOP = 0x0002
    SHUTDOWN = 0x0006
    SWITCH_ON = 0x0007
    ENABLE_OPERATION = 0x000F
    FAULT_RESET = 0x0080


# Statusword: (mask, value) of each state; CiA 402-2, table 30. Bit 5 (quick stop) counts only where it is in the mask.
_STATES = (
    (0x004F, 0x0000, DriveState.NOT_READY),
    (0x004F, 0x0040, DriveState.SWITCH_ON_DISABLED),
    (0x006F, 0x0021, DriveState.READY),
    (0x006F, 0x0023, DriveState.SWITCHED_ON),
    (0x006F, 0x0027, DriveState.ENABLED),
    (0x006F, 0x0007, DriveState.QUICK_STOP),
    (0x004F, 0x000F, DriveState.FAULT_REACTION),
    (0x004F, 0x0008, DriveState.FAULT),
)
_REMOTE = 1 << 9  # the drive follows the controlword
_TARGET_REACHED = 1 << 10
_SPEED_ZERO = 1 << 12  # profile velocity mode


def state_of(statusword: int) -> DriveState:
    """Return the state in a statusword."""
    for mask, value, state in _STATES:
        if statusword & mask == value:
            return state
    return DriveState.UNKNOWN


def target_reached(statusword: int) -> bool:
    """Whether the drive turns at its target velocity."""
    return bool(statusword & _TARGET_REACHED)


def at_standstill(statusword: int) -> bool:
    """Whether the drive is at standstill (profile velocity mode)."""
    return bool(statusword & _SPEED_ZERO)


def enabling_step(state: DriveState, last: Controlword) -> Controlword | None:
    """Return the controlword of the next transition towards operation enabled.

    None: the drive is there, or the next transition is automatic. A fault is reset by a rising edge of bit 7, so where
    the last word had the bit set already (a reset without effect), the bit goes to 0 first.
    """
    match state:
        case DriveState.FAULT:
            return Controlword.DISABLE_VOLTAGE if last is Controlword.FAULT_RESET else Controlword.FAULT_RESET
        case DriveState.QUICK_STOP:
            return Controlword.DISABLE_VOLTAGE
        case DriveState.SWITCH_ON_DISABLED:
            return Controlword.SHUTDOWN
        case DriveState.READY:
            return Controlword.SWITCH_ON
        case DriveState.SWITCHED_ON:
            return Controlword.ENABLE_OPERATION
        case _:
            return None
