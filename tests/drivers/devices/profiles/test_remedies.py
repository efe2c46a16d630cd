"""What the composition of a device advises where an object is lacking."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from regolithd.drivers.devices.inclinometer import INCLINOMETER
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.profiles.choice import DeviceChoice
from regolithd.drivers.devices.profiles.compose import _Composition, compose
from regolithd.drivers.devices.profiles.shipped import profiles

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("device", [MOTOR_CONTROLLER, LOAD_CELL])
def test_the_other_profiles_are_named(device: object) -> None:
    """Those of the same kind of device, without the one that does not fit."""
    known = profiles(device)  # type: ignore[arg-type]
    for profile in known:
        told = _Composition(device, profile, DeviceChoice())._cure("load_N")  # type: ignore[arg-type]
        others = ", ".join(each.name for each in known if each.name != profile.name)
        assert told.startswith(f"Choose the profile of this device ({others}), or say where it lies: ")
        assert "`load_N = {object" in told


def test_a_device_of_one_profile_has_no_other() -> None:
    """Then the objects alone can be named."""
    (own,) = profiles(INCLINOMETER)
    told = _Composition(INCLINOMETER, own, DeviceChoice())._cure("pitch_rad")
    assert told == ('Say where it lies: `pitch_rad = {object = "0x…", unit = "…"}` in [devices.inclinometer.objects]')


CELL = "[1800]\nObjectType=9\n[1A00]\nObjectType=9\n"
ENTRY = "[{index}]\nObjectType=8\nDataType=4\nAccessType=ro\nPDOMapping={mapped}\nCompactSubObj=4\n"


@pytest.mark.parametrize(
    ("entries", "said", "place"),
    [
        ("", "load_N: the EDS file cell.eds has none of 0x9130:03, 0x6130:03, 0x7130:03", None),
        (ENTRY.format(index="7130", mapped=0), "load_N: may not be mapped to a PDO, according to cell.eds", 0x7130),
        (ENTRY.format(index="7130", mapped=1), "load_N: the EDS file cell.eds has no such object", 0x6131),
    ],
)
def test_what_is_wrong_with_the_object_that_is_there_is_said(
    tmp_path: Path, entries: str, said: str, place: int | None
) -> None:
    """Not that another one, which could hold the load as well, is absent; the remedy is for the configured channel."""
    path = tmp_path / "cell.eds"
    path.write_text(CELL + entries)
    _, problems = compose(LOAD_CELL, DeviceChoice("cia404", path, 3))
    assert (problems[0].what, problems[0].index) == (said, place)
    assert 'load_N = {object = "0x9130:03", unit = "N"}' in problems[0].remedy
