"""The EDS files load without warnings and have the necessary objects."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import canopen
import pytest

from regolithd.drivers.devices.ground_speed import GROUND_SPEED_SENSOR
from regolithd.drivers.devices.inclinometer import INCLINOMETER
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.registry import DEVICES

if TYPE_CHECKING:
    from canopen import ObjectDictionary

    from regolithd.drivers.devices.device import Device

COMMUNICATION = (0x1000, 0x1001, 0x1003, 0x1005, 0x1008, 0x1014, 0x1016, 0x1017, 0x1018, 0x1200, 0x1800, 0x1A00)
APPLICATION = {
    MOTOR_CONTROLLER: (
        *(0x2027, 0x2028, 0x2F00, 0x6040, 0x6041, 0x605A, 0x6060, 0x6061, 0x606C),
        *(0x6078, 0x6079, 0x6083, 0x6084, 0x6085, 0x60FF, 0x1400, 0x1600),
    ),
    LOAD_CELL: (0x9130, 0x6150, 0x6131, 0x6132),
    INCLINOMETER: (0x6000, 0x6010, 0x6020, 0x2010),
    GROUND_SPEED_SENSOR: (0x2100, 0x2101, 0x2102),
}
TPDO = {
    MOTOR_CONTROLLER: ((0x6041, 0, 16), (0x6078, 0, 16), (0x606C, 0, 32), (0x6079, 0, 32), (0x2F00, 0, 16)),
    LOAD_CELL: ((0x9130, 1, 32), (0x6150, 1, 8)),
    INCLINOMETER: ((0x6010, 0, 16), (0x6020, 0, 16), (0x2010, 0, 16)),
    GROUND_SPEED_SENSOR: ((0x2100, 0, 32), (0x2101, 6, 32), (0x2102, 0, 8)),
}


def load(device: Device) -> ObjectDictionary:
    """Read an EDS file for node 9, with every warning an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return canopen.import_od(str(device.eds), node_id=9)


@pytest.mark.parametrize("device", DEVICES, ids=lambda device: device.kind)
def test_every_eds_file_loads_without_a_warning(device: Device, caplog: pytest.LogCaptureFixture) -> None:
    """The canopen package reads the file without a warning and finds every object that master and virtual node use."""
    od = load(device)
    assert not caplog.records
    assert [hex(index) for index in (*COMMUNICATION, *APPLICATION[device]) if index not in od] == []


@pytest.mark.parametrize("device", DEVICES, ids=lambda device: device.kind)
def test_pdo_objects_may_be_mapped(device: Device) -> None:
    """Every object of the PDO layout is mappable and has the expected size, and identity and heartbeat are not."""
    od = load(device)
    for index, sub, bits in TPDO[device]:
        entry = od.get_variable(index, sub)
        assert entry.pdo_mappable, hex(index)
        assert len(entry) == bits
    assert not od.get_variable(0x1018, 1).pdo_mappable
    assert not od[0x1017].pdo_mappable


@pytest.mark.parametrize("device", DEVICES, ids=lambda device: device.kind)
def test_an_unconfigured_node_has_every_pdo_disabled(device: Device) -> None:
    """COB-ID bit 31 is set in each default, so that a node sends PDOs only after configuration."""
    od = load(device)
    communication = [index for index in od if 0x1400 <= index < 0x1600 or 0x1800 <= index < 0x1A00]
    assert communication
    for index in communication:
        assert od.get_variable(index, 1).default & 0x8000_0000
        assert od.get_variable(index, 1).default & 0x7F == 9


@pytest.mark.parametrize("device", DEVICES, ids=lambda device: device.kind)
def test_the_object_lists_are_complete(device: Device) -> None:
    """The sections `MandatoryObjects` etc. list exactly the objects of the file (CiA 306)."""
    listed = set()
    for line in device.eds.read_text().splitlines():
        number, _, value = line.partition("=")
        if number.isdigit():
            listed.add(int(value, 16))
    assert listed == set(load(device))
