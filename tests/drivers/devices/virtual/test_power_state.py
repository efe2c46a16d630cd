"""The virtual drive's state machine, compared with tables written from CiA 402-2 independently of the code."""

from __future__ import annotations

import itertools

import pytest
from virtual_master import DriveUnderTest

from regolithd.drivers.devices.virtual.power_state import PowerState, next_state

NRTSO, SOD, RTSO, SO, OE, QSA, FRA, FAULT = (
    PowerState.NOT_READY_TO_SWITCH_ON,
    PowerState.SWITCH_ON_DISABLED,
    PowerState.READY_TO_SWITCH_ON,
    PowerState.SWITCHED_ON,
    PowerState.OPERATION_ENABLED,
    PowerState.QUICK_STOP_ACTIVE,
    PowerState.FAULT_REACTION_ACTIVE,
    PowerState.FAULT,
)

# Command coding, CiA 402-2 table 30: which bits count, and what they are.
SHUTDOWN = (0b1000_0111, 0b0000_0110)
SWITCH_ON = (0b1000_1111, 0b0000_0111)
ENABLE = (0b1000_1111, 0b0000_1111)
DISABLE_VOLTAGE = (0b1000_0010, 0b0000_0000)
QUICK_STOP = (0b1000_0110, 0b0000_0010)

# Transitions, figure 2 and table 28: number, from, command, to.
TRANSITIONS = [
    (2, SOD, SHUTDOWN, RTSO),
    (3, RTSO, SWITCH_ON, SO),
    (34, RTSO, ENABLE, OE),  # 'automatic transition to enable operation after executing switched on'
    (4, SO, ENABLE, OE),
    (5, OE, SWITCH_ON, SO),  # the same bits mean 'disable operation' there
    (6, SO, SHUTDOWN, RTSO),
    (7, RTSO, QUICK_STOP, SOD),
    (7, RTSO, DISABLE_VOLTAGE, SOD),
    (8, OE, SHUTDOWN, RTSO),
    (9, OE, DISABLE_VOLTAGE, SOD),
    (10, SO, DISABLE_VOLTAGE, SOD),
    (10, SO, QUICK_STOP, SOD),
    (11, OE, QUICK_STOP, QSA),
    (12, QSA, DISABLE_VOLTAGE, SOD),
]


def expected(state: PowerState, controlword: int, before: int, option: int) -> PowerState:
    """Look a controlword up in the tables above."""
    if state is FAULT:
        return SOD if controlword & 0x80 and not before & 0x80 else FAULT  # 15: a rising edge
    if state is QSA and option in {5, 6} and controlword & ENABLE[0] == ENABLE[1]:
        return OE  # 16
    for _, source, (mask, value), target in TRANSITIONS:
        if state is source and controlword & mask == value:
            return target
    return state


@pytest.mark.parametrize("state", PowerState)
def test_every_controlword_has_the_effect_of_the_standard(state: PowerState) -> None:
    """All low bytes of the controlword, after each state of bit 7, with each quick stop option."""
    for controlword, before, option in itertools.product(range(256), (0x00, 0x80), (2, 6)):
        reached = next_state(state, controlword, before, quick_stop_option=option)
        assert reached is expected(state, controlword, before, option), (hex(controlword), hex(before), option)


@pytest.mark.parametrize(
    ("state", "mask", "bits"),
    [
        (NRTSO, 0x4F, 0x00),
        (SOD, 0x4F, 0x40),
        (RTSO, 0x6F, 0x21),
        (SO, 0x6F, 0x23),
        (OE, 0x6F, 0x27),
        (QSA, 0x6F, 0x07),
        (FRA, 0x4F, 0x0F),
        (FAULT, 0x4F, 0x08),
    ],
)
def test_each_state_has_its_bits_in_the_statusword(state: PowerState, mask: int, bits: int) -> None:
    """State coding of CiA 402-2, table 31, is unique."""
    assert state.value & mask == bits
    assert sum(other.value & mask == bits for other in PowerState) == 1


def test_the_states_up_and_down_over_the_bus() -> None:
    """Each controlword in a PDO gives the next state in the statusword, and one that skips a state is ignored."""
    drive = DriveUnderTest()
    assert drive.state == 0x40
    assert drive.send_controlword(0x0F) == 0x40  # enable operation: illegal from here
    assert drive.send_controlword(0x07) == 0x40
    assert drive.send_controlword(0x06) == 0x21
    assert drive.send_controlword(0x07) == 0x23
    assert drive.send_controlword(0x0F) == 0x27
    assert drive.send_controlword(0x07) == 0x23
    assert drive.send_controlword(0x06) == 0x21
    assert drive.send_controlword(0x00) == 0x40


def test_a_fault_is_reset_by_a_rising_edge_only() -> None:
    """Bit 7 that is constant or falls has no effect, and no other command leaves fault."""
    drive = DriveUnderTest()
    drive.send_controlword(0x80)
    drive.master.rover.inject_fault("fault 1 0x2310")
    assert drive.state == 0x08
    assert drive.send_controlword(0x80) == 0x08  # no edge: it was set before the fault
    for controlword in (0x06, 0x07, 0x0F, 0x00):
        assert drive.send_controlword(controlword) == 0x08
    assert drive.send_controlword(0x80) == 0x40
