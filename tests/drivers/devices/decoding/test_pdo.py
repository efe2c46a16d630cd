"""The PDO layouts of the devices, checked against their EDS files."""

from __future__ import annotations

import pytest

from regolithd.drivers.devices.decoding.pdo import compile_pdo, tpdos
from regolithd.drivers.devices.device import Commanded, Measured, PdoLayout, Validity
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.registry import DEVICES
from regolithd.drivers.errors import DictionaryError


def test_a_layout_is_checked_against_the_eds() -> None:
    """Missing and unmappable objects and more than 8 bytes are refused, with the object in the message."""
    for entries, what in (
        (((0x6123, 0),), "no such object"),
        (((0x1017, 0),), "may not be mapped"),
        (((0x606C, 0), (0x60FF, 0), (0x6041, 0)), "a frame carries 8"),
    ):
        layout = PdoLayout(1, tuple(Commanded(*entry) for entry in entries))
        with pytest.raises(DictionaryError, match=what):
            compile_pdo(MOTOR_CONTROLLER, layout, transmit=True)


def test_every_mapped_measurement_has_a_meaning() -> None:
    """Every object of a TPDO is a measurement or a status, and is sent at every SYNC."""
    for device in DEVICES:
        for each in tpdos(device, diagnostics=True):
            assert all(isinstance(mapped, Measured | Validity) for mapped in each.objects)
            assert each.transmission_type == 1
