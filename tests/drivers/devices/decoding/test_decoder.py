"""Decoding: exact values for known frames, and no exception for arbitrary frames."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen.emcy import Emergency, emergency_frame, register_bits
from regolithd.drivers.canopen.nmt import NmtState, state_frame
from regolithd.drivers.devices.decoding.decoder import Decoder, Undecodable
from regolithd.drivers.devices.decoding.signals import NodeState, Reading, Sync
from regolithd.drivers.devices.ground_speed import GROUND_SPEED
from regolithd.drivers.devices.inclinometer import PITCH, ROLL, YAW_RATE
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import (
    BUS_VOLTAGE,
    MOTOR_CONTROLLER,
    MOTOR_CURRENT,
    MOTOR_SPEED,
    MOTOR_TEMPERATURE,
    STATUSWORD,
)
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.virtual.rover import KAPVIK

NODES = (*KAPVIK[1:], NodeDescription(1, MOTOR_CONTROLLER, 0, diagnostics=True))
BUSY_IDS = st.sampled_from(
    [base + node.node_id for base in (0x80, 0x180, 0x200, 0x280, 0x580, 0x600, 0x700) for node in NODES]
    + [0, 0x80, 0x77F]
)
FRAMES = st.builds(
    Frame,
    time_ns=st.integers(0, 2**62),
    can_id=BUSY_IDS | st.integers(0, 0x7FF) | st.integers(0, 0x1FFFFFFF),
    data=st.binary(max_size=8),
    extended=st.booleans(),
    remote=st.booleans(),
    error=st.booleans(),
    sent=st.booleans(),
)


def test_a_motors_tpdo_is_decoded_to_si_units() -> None:
    """The bytes of −80 mA and 3922 rpm give the exact values."""
    frame = Frame(5, 0x181, struct.pack("<Hhi", 0x0637, -80, 3922))
    reading = Decoder(NODES).decode(frame)
    assert reading == Reading(
        5,
        1,
        0x181,
        (
            (STATUSWORD, 0x0637),
            (MOTOR_CURRENT, pytest.approx(-0.080)),
            (MOTOR_SPEED, pytest.approx(3922 * 2 * math.pi / 60)),
        ),
    )


def test_a_mirrored_motors_signs_are_inverted() -> None:
    """Current and speed are inverted, the statusword is not, and no value is minus zero."""
    mirrored = Decoder([NodeDescription(2, MOTOR_CONTROLLER, 1, mirrored=True)])
    values = dict(mirrored.decode(Frame(5, 0x182, struct.pack("<Hhi", 0x0637, -80, 0))).values)
    assert values[STATUSWORD] == 0x0637
    assert values[MOTOR_CURRENT] == pytest.approx(0.080)
    assert math.copysign(1.0, values[MOTOR_SPEED]) == 1.0


def test_diagnostics_and_sensors_are_decoded_to_si_units() -> None:
    """Supply voltage and temperature, load, slopes and yaw rate, and ground speed are exact."""
    decoder = Decoder(NODES)
    sent = {
        0x281: (struct.pack("<Ih", 23456, -35), {BUS_VOLTAGE: 23.456, MOTOR_TEMPERATURE: -3.5}),
        0x18B: (struct.pack("<iB", 3160, 0), {LOAD: 31.60}),
        0x195: (
            struct.pack("<hhh", -1000, 250, 90),
            {
                PITCH: math.radians(-10),
                ROLL: math.radians(2.5),
                YAW_RATE: math.radians(0.9),
            },
        ),
        0x196: (struct.pack("<iB", 2200, 0), {GROUND_SPEED: 0.022}),
    }
    for can_id, (data, expected) in sent.items():
        assert dict(decoder.decode(Frame(0, can_id, data)).values) == pytest.approx(expected)


@pytest.mark.parametrize("status", range(1, 8))
def test_an_invalid_load_gives_no_value(status: int) -> None:
    """With not valid or overload in the status, the reading has no value."""
    assert Decoder(NODES).decode(Frame(3, 0x18B, struct.pack("<iB", 3160, status))) == Reading(3, 11, 0x18B, ())


def test_services_are_distinguished() -> None:
    """SYNC, heartbeat, boot-up and emergency are signals, and other services give None and no error."""
    decoder = Decoder(NODES)
    assert decoder.decode(Frame(7, 0x80, b"")) == Sync(7)
    assert decoder.decode(state_frame(NmtState.OPERATIONAL, 3)) == NodeState(0, 3, NmtState.OPERATIONAL)
    assert decoder.decode(state_frame(NmtState.BOOT_UP, 11)) == NodeState(0, 11, NmtState.BOOT_UP)
    emergency = decoder.decode(emergency_frame(3, 0x2310, 0x03, b"\1\2\3\4\5"))
    assert emergency == Emergency(
        0, 3, 0x2310, 3, b"\1\2\3\4\5", "overcurrent: short circuit, or the current controller is badly tuned"
    )
    assert register_bits(emergency.register) == ("generic", "current")
    for can_id in (0x000, 0x583, 0x603, 0x203, 0x77F):
        assert decoder.decode(Frame(0, can_id, bytes(8))) is None
    assert not decoder.undecodable


def test_what_cannot_be_decoded_is_counted_by_its_reason() -> None:
    """Each reason has its own counter."""
    decoder = Decoder(NODES)
    for frame in (
        Frame(0, 0x19E, bytes(8)),
        Frame(0, 0x181, bytes(7)),
        Frame(0, 0x83, bytes(3)),
        Frame(0, 0x703, b"\x09"),
        Frame(0, 0x703, b""),
        Frame(0, 0x181, bytes(8), extended=True),
        Frame(0, 0x181, b"", remote=True),
    ):
        assert decoder.decode(frame) is None
    assert decoder.undecodable == {
        Undecodable.UNKNOWN_COB_ID: 1,
        Undecodable.WRONG_LENGTH: 3,
        Undecodable.UNKNOWN_STATE: 1,
        Undecodable.EXTENDED: 1,
        Undecodable.REMOTE: 1,
    }


def test_expected_lists_every_configured_tpdo() -> None:
    """Fourteen nodes, one of them with a second TPDO, have fifteen COB-IDs."""
    assert len(Decoder(NODES).expected) == 15
    assert {0x181, 0x281, 0x18B, 0x195, 0x196} <= Decoder(NODES).expected


@given(st.lists(FRAMES, max_size=50))
def test_every_frame_is_decoded_ignored_or_counted(frames: list[Frame]) -> None:
    """Every frame is a signal, without signal by design, or counted; equal frames give equal signals."""
    decoder, again = Decoder(NODES), Decoder(NODES)
    silent = 0
    for frame in frames:
        before = decoder.undecodable.total()
        signal = decoder.decode(frame)
        assert signal == again.decode(frame)
        counted = decoder.undecodable.total() - before
        assert counted in (0, 1)
        assert not (counted and signal)
        silent += signal is None and not counted
    useless = {0, 0x77F} | {base + node.node_id for base in (0x580, 0x600) for node in NODES}
    useless |= {0x200 + node.node_id for node in NODES if node.device.rpdos}
    assert silent == sum(frame.error or (frame.ordinary and frame.can_id in useless) for frame in frames)
