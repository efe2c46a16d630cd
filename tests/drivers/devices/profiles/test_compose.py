"""The user's own objects and units beside a profile's: what is taken, and what is told where they do not suit."""

from __future__ import annotations

import pytest

from regolithd.drivers.devices.device import Measured
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.profiles.choice import DeviceChoice, Placement
from regolithd.drivers.devices.profiles.compose import compose
from regolithd.drivers.devices.units import RAD_S_PER_RPM, STATED_UNITS


def placed(placement: Placement) -> tuple[list[Measured], list[str]]:
    """Return what a drive measures with a placement beside its profile, and what is told."""
    device, problems = compose(MOTOR_CONTROLLER, DeviceChoice("cia402", placements=(placement,)))
    layouts = device.tpdos if device else ()
    measured = [each for layout in layouts for each in layout.objects if isinstance(each, Measured)]
    of_quantity = [each for each in measured if each.quantity.name == placement.quantity]
    return of_quantity, [f"{problem.what}. {problem.remedy}" for problem in problems]


@pytest.mark.parametrize(
    ("placement", "scale"),
    [
        (Placement("motor_current_A", unit="mA"), 1e-3),
        (Placement("motor_current_A", unit="rated-current-permille"), STATED_UNITS["rated-current-permille"][0]),
        (Placement("motor_current_A", scale=0.0025), 0.0025),
        (Placement("motor_speed_rad_s", unit="mrpm"), 1e-3 * RAD_S_PER_RPM),
        (Placement("motor_speed_rad_s", unit="si-unit-velocity"), STATED_UNITS["si-unit-velocity"][0]),
    ],
)
def test_a_unit_of_the_quantity_s_dimension_is_taken(placement: Placement, scale: object) -> None:
    """A fixed one, one that the device states, or a scale; the object stays the profile's."""
    (measured,), problems = placed(placement)
    assert problems == []
    assert measured.scale == scale
    assert measured.index == (0x6078 if placement.quantity == "motor_current_A" else 0x606C)


@pytest.mark.parametrize(
    ("placement", "told"),
    [
        (
            Placement("motor_current_A", unit="rpm"),
            "motor_current_A cannot be in the unit 'rpm'. Take one of A, mA, rated-current-permille; or a scale",
        ),
        (
            Placement("motor_current_A", unit="encoder-increments"),
            "motor_current_A cannot be in the unit 'encoder-increments'. Take one of A, mA, rated-current-permille",
        ),
        (Placement("load_N", unit="N"), "a motor has no quantity 'load_N'. It has "),
    ],
)
def test_a_unit_of_another_dimension_is_told_with_those_that_suit(placement: Placement, told: str) -> None:
    """And a quantity that the device has not with those that it has."""
    measured, problems = placed(placement)
    assert measured == []
    assert [problem for problem in problems if problem.startswith(told)]
