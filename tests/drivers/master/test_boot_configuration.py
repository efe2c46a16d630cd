"""The list of writes that configures a node."""

from __future__ import annotations

from regolithd.drivers.devices.inclinometer import INCLINOMETER
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.devices.registry import DEVICES
from regolithd.drivers.master.boot_configuration import boot_writes


def test_a_pdo_is_configured_in_the_order_of_cia_301() -> None:
    """A PDO is disabled, mapped and enabled in this order, and unused PDOs are disabled."""
    writes = boot_writes(
        NodeDescription(3, MOTOR_CONTROLLER, 2), heartbeat_s=0.2, master_id=127, master_lost_after_s=0.5
    )
    first = [(write.index, write.subindex, write.value) for write in writes if write.index in (0x1800, 0x1A00)]
    assert first == [
        (0x1800, 1, 0x80000000),
        (0x1800, 2, 1),
        (0x1A00, 0, 0),
        (0x1A00, 1, 0x60410010),
        (0x1A00, 2, 0x60780010),
        (0x1A00, 3, 0x606C0020),
        (0x1A00, 0, 3),
        (0x1800, 1, 0x183),
    ]
    unused = [write.index for write in writes if write.subindex == 1 and write.keep]
    assert {0x1801, 0x1802, 0x1803, 0x1401, 0x1402, 0x1403} <= set(unused)
    assert (0x1016, 1, 127 << 16 | 500) in [(write.index, write.subindex, write.value) for write in writes]


def test_units_are_set_or_compared() -> None:
    """A unit is written where the EDS allows it, and compared otherwise."""
    of = {
        device: boot_writes(NodeDescription(9, device, 0), heartbeat_s=0.2, master_id=127, master_lost_after_s=0.5)
        for device in DEVICES
    }
    resolution = next(write for write in of[INCLINOMETER] if write.index == 0x6000)
    assert (resolution.value, resolution.read_only) == (10, False)
    digits = next(write for write in of[LOAD_CELL] if write.index == 0x6132)
    assert (digits.value, digits.read_only) == (2, True)


def test_disabling_a_pdo_keeps_its_identifier() -> None:
    """CiA 301 forbids to change identifier and bit 31 at once."""
    off = boot_writes(NodeDescription(3, LOAD_CELL, 2), heartbeat_s=0.2, master_id=127, master_lost_after_s=0.5)[2]
    assert off.data(present=0x40000183) == (0xC0000183).to_bytes(4, "little")


def test_what_is_read_back_is_compared_in_all_bits_of_the_object() -> None:
    """Size and mask are those of the data type; a PDO's COB-ID is compared but for the bit that a device may set."""
    writes = boot_writes(
        NodeDescription(3, MOTOR_CONTROLLER, 2), heartbeat_s=0.2, master_id=127, master_lost_after_s=0.5
    )
    found = {(write.index, write.subindex): (write.size, write.mask, write.signed) for write in writes}
    assert found[0x6060, 0] == (1, 0xFF, True)
    assert found[0x605A, 0] == (2, 0xFFFF, True)
    assert found[0x1017, 0] == (2, 0xFFFF, False)
    assert found[0x1A00, 1] == (4, 0xFFFF_FFFF, False)
    assert found[0x1016, 1] == (4, 0xFFFF_FFFF, False)
    assert found[0x1800, 1] == (4, 0xBFFF_FFFF, False)
    assert found[0x1801, 1] == (4, 0x8000_0000, False)
    values = {(write.index, write.subindex): write.value for write in writes}
    assert (values[0x1017, 0], values[0x1005, 0], values[0x1014, 0]) == (200, 0x80, 0x83)
    masks = {write.index: write.mask for write in writes if write.index in (0x1005, 0x1014)}
    assert masks == {0x1005: 0x4000_07FF, 0x1014: 0x8000_07FF}
