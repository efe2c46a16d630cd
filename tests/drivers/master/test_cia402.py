"""The drive's state machine in the master, compared with the table of the standard and with a simulated drive."""

from __future__ import annotations

from itertools import pairwise

import pytest

from regolithd.drivers.master.cia402 import Controlword, DriveState, enabling_step, state_of

# CiA 402-2, table 30, as printed: bits 6 5 3 2 1 0, x for any.
PRINTED = {
    DriveState.NOT_READY: "0x0000",
    DriveState.SWITCH_ON_DISABLED: "1x0000",
    DriveState.READY: "010001",
    DriveState.SWITCHED_ON: "010011",
    DriveState.ENABLED: "010111",
    DriveState.QUICK_STOP: "000111",
    DriveState.FAULT_REACTION: "0x1111",
    DriveState.FAULT: "0x1000",
}


def printed_state(statusword: int) -> DriveState:
    """Return the state by the printed table."""
    bits = "".join(str(statusword >> bit & 1) for bit in (6, 5, 3, 2, 1, 0))
    found = [
        state
        for state, pattern in PRINTED.items()
        if all(wanted in ("x", bit) for wanted, bit in zip(pattern, bits, strict=True))
    ]
    assert len(found) <= 1
    return found[0] if found else DriveState.UNKNOWN


def test_every_statusword_gives_the_state_of_the_standard() -> None:
    """All 65 536 statuswords agree with CiA 402-2, table 30."""
    assert [word for word in range(1 << 16) if state_of(word) is not printed_state(word)] == []


class StandardDrive:
    """CiA 402's transitions, reacting to controlwords; a fault is reset by a rising edge of bit 7 alone."""

    def __init__(self, state: DriveState) -> None:
        self.state = state
        self.before = 0xFFFF  # the worst case: bit 7 was 1

    def obey(self, word: int) -> None:
        """React to a controlword."""
        rising = word & ~self.before & 0x80
        self.before = word
        if self.state is DriveState.FAULT:
            if rising:
                self.state = DriveState.SWITCH_ON_DISABLED
        elif not word & 0x2:
            self.state = DriveState.SWITCH_ON_DISABLED
        elif not word & 0x4:
            if self.state is DriveState.ENABLED:
                self.state = DriveState.QUICK_STOP
            elif self.state is not DriveState.QUICK_STOP:
                self.state = DriveState.SWITCH_ON_DISABLED
        else:
            self._rise(word & 0xF)

    def _rise(self, low: int) -> None:
        steps = {
            (DriveState.SWITCH_ON_DISABLED, 0x6): DriveState.READY,
            (DriveState.READY, 0x7): DriveState.SWITCHED_ON,
            (DriveState.SWITCHED_ON, 0xF): DriveState.ENABLED,
            (DriveState.SWITCHED_ON, 0x6): DriveState.READY,
            (DriveState.ENABLED, 0x7): DriveState.SWITCHED_ON,
            (DriveState.ENABLED, 0x6): DriveState.READY,
        }
        self.state = steps.get((self.state, low), self.state)


@pytest.mark.parametrize(
    "state",
    [
        DriveState.SWITCH_ON_DISABLED,
        DriveState.READY,
        DriveState.SWITCHED_ON,
        DriveState.ENABLED,
        DriveState.QUICK_STOP,
        DriveState.FAULT,
    ],
)
def test_enabling_reaches_operation_enabled_from_every_state(state: DriveState) -> None:
    """At most six controlwords are necessary, whatever the previous one was."""
    drive, last, words = StandardDrive(state), Controlword.FAULT_RESET, []
    for _ in range(6):
        word = enabling_step(drive.state, last)
        if word is None:
            break
        words.append(word)
        drive.obey(word)
        last = word
    assert drive.state is DriveState.ENABLED, words


def test_a_fault_reset_is_repeated_with_a_rising_edge() -> None:
    """Bit 7 alternates while the fault remains."""
    last = Controlword.DISABLE_VOLTAGE
    words = [last]
    for _ in range(6):
        last = enabling_step(DriveState.FAULT, last)
        words.append(last)
    assert all((one & 0x80) != (two & 0x80) for one, two in pairwise(words))


def test_no_command_is_sent_during_the_fault_reaction() -> None:
    """The transition from fault reaction active is automatic."""
    for state in (DriveState.NOT_READY, DriveState.FAULT_REACTION, DriveState.ENABLED, DriveState.UNKNOWN):
        assert enabling_step(state, Controlword.SHUTDOWN) is None
