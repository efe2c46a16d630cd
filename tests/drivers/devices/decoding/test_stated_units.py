"""Units that a device states, taken from the answers of its SDO server."""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any

import pytest

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.devices.decoding.stated_units import StatedUnits
from regolithd.drivers.devices.units import STATED_UNITS

RATED_CURRENT = (0x6075, 0)
(PERMILLE,) = STATED_UNITS["rated-current-permille"]
DEVICE: Any = SimpleNamespace(stated_units=(RATED_CURRENT,))


def answer(command: int, value: bytes, index: int = RATED_CURRENT[0]) -> Frame:
    """Return an answer of the server: command specifier, object and value."""
    return Frame(0, 0x581, struct.pack("<BHB4s", command, index, 0, value))


def test_a_unit_is_known_once_its_object_was_read() -> None:
    """The rated current is in mA, and a value per mille of it; a fixed unit is always known."""
    units = StatedUnits(DEVICE)
    assert units
    assert units.factor(PERMILLE) is None
    assert units.factor(0.25) == 0.25
    units.take(answer(0x43, struct.pack("<I", 3000)))
    assert units.factor(PERMILLE) == pytest.approx(0.003)
    assert not StatedUnits(SimpleNamespace(stated_units=()))  # type: ignore[arg-type]


@pytest.mark.parametrize(("command", "value"), [(0x47, 0x03_0201), (0x4B, 0x0201), (0x4F, 0x01)])
def test_only_the_bytes_that_are_used_are_a_value(command: int, value: int) -> None:
    """Bits 2 and 3 of the command count those that are not (CiA 301, 7.2.4.3.6)."""
    units = StatedUnits(DEVICE)
    units.take(answer(command, b"\1\2\3\4"))
    assert units.factor(PERMILLE) == pytest.approx(1e-6 * value)


@pytest.mark.parametrize(
    "frame",
    [
        answer(0x41, b"\1\0\0\0"),  # a segmented upload begins
        answer(0x60, b"\1\0\0\0"),  # a download is confirmed
        answer(0x80, b"\1\0\0\0"),  # an abort
        answer(0x43, b"\1\0\0\0", index=0x6076),
        Frame(0, 0x581, answer(0x43, b"\1\0\0\0").data[:7]),
        Frame(0, 0x581, answer(0x43, b"\1\0\0\0").data + b"\0"),
    ],
)
def test_what_is_no_answer_of_a_wanted_object_is_left_alone(frame: Frame) -> None:
    """Other services, other objects and frames of another length."""
    units = StatedUnits(DEVICE)
    units.take(frame)
    assert (units.factor(PERMILLE), units.frames) == (None, {})


def test_a_change_is_told_once_and_the_last_answer_is_kept() -> None:
    """The same value again changes nothing; the recording repeats the frame that stated it."""
    units, changes = StatedUnits(DEVICE), []
    units.notify(lambda: changes.append(units.factor(PERMILLE)))
    frames = [answer(0x43, struct.pack("<I", value)) for value in (1000, 1000, 2000)]
    for frame in frames:
        units.take(frame)
    assert changes == pytest.approx([0.001, 0.002])
    assert units.frames == {RATED_CURRENT: frames[-1]}
    units.take(answer(0x43, bytes(4)))
    assert units.factor(PERMILLE) is None
