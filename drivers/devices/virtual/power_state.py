"""The power drive system's state machine (CiA 402-2, figure 2) inside the virtual motor controller.

    0 start ▸ NOT READY TO SWITCH ON ▸ 1 ▸ SWITCH ON DISABLED ◂──────────────┐
                                           2 ▾ ▴ 7                           │
                                      READY TO SWITCH ON ◂──────┐            │ 15 fault reset
                                           3 ▾ ▴ 6              │ 8          │
                                         SWITCHED ON   10 ▸ …   │          FAULT
                                           4 ▾ ▴ 5              │            ▴ 14
                                      OPERATION ENABLED ────────┘      FAULT REACTION ACTIVE
                                      11 ▾ ▴ 16    9 ▸ SWITCH ON DISABLED    ▴ 13 from anywhere
                                      QUICK STOP ACTIVE ▸ 12 ▸ SWITCH ON DISABLED

The master's side of the state machine (`master.cia402`) is written independently and shares no code with this one, so
that a misreading of the standard does not pass on both sides. Everything here is pure.
"""

from __future__ import annotations

from enum import Enum, StrEnum


class PowerState(Enum):
    """A state; its value is the statusword's state bits (0, 1, 2, 3, 5, 6)."""

    NOT_READY_TO_SWITCH_ON = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION_ACTIVE = 0x0F
    FAULT = 0x08


class Command(StrEnum):
    """What a controlword asks for, fault reset apart (CiA 402-2, table 30)."""

    SHUTDOWN = "shutdown"
    SWITCH_ON = "switch on"  # also: disable operation
    ENABLE_OPERATION = "enable operation"  # also: switch on and enable operation
    DISABLE_VOLTAGE = "disable voltage"
    QUICK_STOP = "quick stop"


FAULT_RESET = 0x80
HALT = 0x100

_S, _C = PowerState, Command
_TRANSITIONS = {
    (_S.SWITCH_ON_DISABLED, _C.SHUTDOWN): _S.READY_TO_SWITCH_ON,  # 2
    (_S.READY_TO_SWITCH_ON, _C.SWITCH_ON): _S.SWITCHED_ON,  # 3
    (_S.READY_TO_SWITCH_ON, _C.ENABLE_OPERATION): _S.OPERATION_ENABLED,  # 3, and 4 by itself
    (_S.SWITCHED_ON, _C.ENABLE_OPERATION): _S.OPERATION_ENABLED,  # 4
    (_S.OPERATION_ENABLED, _C.SWITCH_ON): _S.SWITCHED_ON,  # 5
    (_S.SWITCHED_ON, _C.SHUTDOWN): _S.READY_TO_SWITCH_ON,  # 6
    (_S.READY_TO_SWITCH_ON, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 7
    (_S.READY_TO_SWITCH_ON, _C.QUICK_STOP): _S.SWITCH_ON_DISABLED,  # 7
    (_S.OPERATION_ENABLED, _C.SHUTDOWN): _S.READY_TO_SWITCH_ON,  # 8
    (_S.OPERATION_ENABLED, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 9
    (_S.SWITCHED_ON, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 10
    (_S.SWITCHED_ON, _C.QUICK_STOP): _S.SWITCH_ON_DISABLED,  # 10
    (_S.OPERATION_ENABLED, _C.QUICK_STOP): _S.QUICK_STOP_ACTIVE,  # 11
    (_S.QUICK_STOP_ACTIVE, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 12
}

STAYS_IN_QUICK_STOP = frozenset({5, 6})
"""Quick stop option codes (0x605A) that hold the drive in quick stop active; only then is there a transition 16."""


def command(controlword: int) -> Command:
    """Return what the controlword's bits 0 to 3 ask for."""
    switch_on, enable_voltage = controlword & 1, controlword & 2
    not_quick_stop, enable_operation = controlword & 4, controlword & 8
    if not enable_voltage:
        return Command.DISABLE_VOLTAGE
    if not not_quick_stop:
        return Command.QUICK_STOP
    if not switch_on:
        return Command.SHUTDOWN
    return Command.ENABLE_OPERATION if enable_operation else Command.SWITCH_ON


def next_state(state: PowerState, controlword: int, before: int, *, quick_stop_option: int) -> PowerState:
    """Return the state after a controlword; `before` is the previous one. An illegal command changes nothing."""
    rising = controlword & ~before & FAULT_RESET
    if state is PowerState.FAULT:
        return PowerState.SWITCH_ON_DISABLED if rising else state  # 15
    if controlword & FAULT_RESET:
        return state  # every other command wants bit 7 clear
    wanted = command(controlword)
    if (
        state is PowerState.QUICK_STOP_ACTIVE
        and wanted is Command.ENABLE_OPERATION
        and quick_stop_option in STAYS_IN_QUICK_STOP
    ):
        return PowerState.OPERATION_ENABLED  # 16
    return _TRANSITIONS.get((state, wanted), state)
