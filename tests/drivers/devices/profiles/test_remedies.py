"""What the composition of a device advises where an object is lacking."""

from __future__ import annotations

import pytest

from regolithd.drivers.devices.inclinometer import INCLINOMETER
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.profiles.choice import DeviceChoice
from regolithd.drivers.devices.profiles.compose import _Composition
from regolithd.drivers.devices.profiles.shipped import profiles


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
