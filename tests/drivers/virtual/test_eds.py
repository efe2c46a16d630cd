"""The data sheets load cleanly and say what the bus needs them to say."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import canopen
import pytest

from regolithd.drivers.devices.eds import eds_path
from regolithd.drivers.signals import NodeKind

if TYPE_CHECKING:
    from canopen import ObjectDictionary

COMMUNICATION = (0x1000, 0x1001, 0x1003, 0x1005, 0x1008, 0x1014, 0x1016, 0x1017, 0x1018, 0x1200, 0x1800, 0x1A00)
APPLICATION = {
    NodeKind.MOTOR: (
        *(0x2027, 0x2028, 0x2F00, 0x6040, 0x6041, 0x605A, 0x6060, 0x6061, 0x606C),
        *(0x6078, 0x6079, 0x6083, 0x6084, 0x6085, 0x60FF, 0x1400, 0x1600),
    ),
    NodeKind.LOAD_CELL: (0x9130, 0x6150, 0x6131, 0x6132),
    NodeKind.INCLINOMETER: (0x6000, 0x6010, 0x6020, 0x2010),
    NodeKind.GROUND_SPEED: (0x2100, 0x2101, 0x2102),
}
TPDO = {
    NodeKind.MOTOR: ((0x6041, 0, 16), (0x6078, 0, 16), (0x606C, 0, 32), (0x6079, 0, 32), (0x2F00, 0, 16)),
    NodeKind.LOAD_CELL: ((0x9130, 1, 32), (0x6150, 1, 8)),
    NodeKind.INCLINOMETER: ((0x6010, 0, 16), (0x6020, 0, 16), (0x2010, 0, 16)),
    NodeKind.GROUND_SPEED: ((0x2100, 0, 32), (0x2101, 6, 32), (0x2102, 0, 8)),
}


def load(kind: NodeKind) -> ObjectDictionary:
    """Read a sheet for node 9, with every complaint an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return canopen.import_od(str(eds_path(kind)), node_id=9)


@pytest.mark.parametrize("kind", NodeKind)
def test_every_sheet_loads_without_a_complaint(kind: NodeKind, caplog: pytest.LogCaptureFixture) -> None:
    """Canopen reads the sheet silently and finds every object that either side uses."""
    od = load(kind)
    assert not caplog.records
    assert [hex(index) for index in (*COMMUNICATION, *APPLICATION[kind]) if index not in od] == []


@pytest.mark.parametrize("kind", NodeKind)
def test_what_a_pdo_carries_may_be_mapped(kind: NodeKind) -> None:
    """Every object of the fixed PDO layout is mappable and as long as the layout says; SDO-only objects are not."""
    od = load(kind)
    for index, sub, bits in TPDO[kind]:
        entry = od.get_variable(index, sub)
        assert entry.pdo_mappable, hex(index)
        assert len(entry) == bits
    assert not od.get_variable(0x1018, 1).pdo_mappable
    assert not od[0x1017].pdo_mappable


@pytest.mark.parametrize("kind", NodeKind)
def test_an_unconfigured_node_has_every_pdo_disabled(kind: NodeKind) -> None:
    """COB-ID bit 31 is set in each default, so that a node speaks only once it is configured."""
    od = load(kind)
    communication = [index for index in od if 0x1400 <= index < 0x1600 or 0x1800 <= index < 0x1A00]
    assert communication
    for index in communication:
        assert od.get_variable(index, 1).default & 0x8000_0000
        assert od.get_variable(index, 1).default & 0x7F == 9


@pytest.mark.parametrize("kind", NodeKind)
def test_the_list_of_objects_names_what_the_sheet_holds(kind: NodeKind) -> None:
    """The sections `MandatoryObjects` … agree with the objects that follow (CiA 306)."""
    listed = set()
    for line in eds_path(kind).read_text().splitlines():
        number, _, value = line.partition("=")
        if number.isdigit():
            listed.add(int(value, 16))
    assert listed == set(load(kind))
