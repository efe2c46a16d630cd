"""What a device, a PDO and a node are where their description states nothing, and the registered devices' own table."""

from __future__ import annotations

import pytest

from regolithd.drivers.devices.device import (
    NOTHING_KNOWN,
    Commanded,
    Device,
    Measured,
    PdoLayout,
    Quantity,
    Validity,
)
from regolithd.drivers.devices.ground_speed import GROUND_SPEED_SENSOR
from regolithd.drivers.devices.inclinometer import INCLINOMETER
from regolithd.drivers.devices.load_cell import LOAD_CELL, VirtualLoadCell
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.devices.registry import DEVICES

LOAD = Quantity("load_N", "A load.")
OTHER = Quantity("other_N", "Another one.")


def device(*tpdos: PdoLayout) -> Device:
    """Return a device that states the least."""
    return Device("scale", "scales", LOAD_CELL.eds, 40, tpdos, VirtualLoadCell)


def test_a_device_that_states_nothing_is_a_sensor_of_the_body() -> None:
    """It is not commanded, does not watch the master, has no settings, and nothing is known of its identity."""
    plain = device()
    assert (plain.rpdos, plain.settings, plain.left_out, dict(plain.error_texts)) == ((), (), (), {})
    assert (plain.per_wheel, plain.monitors_master, plain.commanded) == (False, False, False)
    assert plain.identity is NOTHING_KNOWN
    assert (NOTHING_KNOWN.profile_number, NOTHING_KNOWN.vendor, NOTHING_KNOWN.product) == (None, None, None)
    assert NOTHING_KNOWN.revisions is None


def test_a_pdo_that_states_nothing_is_sent_at_each_sync() -> None:
    """Transmission type 1, and it is no diagnostic one; a command is of sub-index 0 in the device's own unit."""
    layout = PdoLayout(1, ())
    assert (layout.transmission_type, layout.diagnostic) == (1, False)
    assert (Commanded(0x60FF).subindex, Commanded(0x60FF).scale) == (0, 1.0)


def test_a_quantity_that_states_nothing_is_one_for_each_wheel_and_may_stay_constant() -> None:
    """It is no bit field, keeps its sign on a mirrored motor, and raises no stuck-sensor alarm."""
    plain = Quantity("x")
    assert (plain.per_wheel, plain.mirrored, plain.flags, plain.noisy) == (True, False, False, False)


def test_a_node_that_states_nothing_is_required_and_turns_forward() -> None:
    """Without diagnostic PDOs, and with any serial number."""
    node = NodeDescription(40, device(), None)
    assert (node.required, node.diagnostics, node.mirrored, node.serial) == (True, False, False, None)
    assert node.kind == "scale"


def test_what_a_device_measures_is_what_its_tpdos_hold() -> None:
    """In their order; the first status object counts."""
    first = PdoLayout(1, (Measured(0x9130, 1, LOAD, 0.01), Validity(0x6150, 1, 0b101)))
    second = PdoLayout(2, (Validity(0x6150, 2, 0b1), Measured(0x9130, 2, OTHER, 0.01)))
    both = device(first, second)
    assert both.quantities == (LOAD, OTHER)
    assert both.validity == Validity(0x6150, 1, 0b101)
    assert device(PdoLayout(1, ())).validity is None
    assert both.stated_units == ()


@pytest.mark.parametrize(
    ("described", "kind", "node_id", "per_wheel", "moves"),
    [
        (MOTOR_CONTROLLER, "motor", 1, True, True),
        (LOAD_CELL, "load-cell", 11, True, False),
        (INCLINOMETER, "inclinometer", 21, False, False),
        (GROUND_SPEED_SENSOR, "ground-speed", 22, False, False),
    ],
)
def test_only_what_moves_the_rover_stops_with_the_master(
    described: Device, kind: str, node_id: int, per_wheel: bool, moves: bool
) -> None:
    """The motor controllers take commands and consume the master's heartbeat; node-IDs are those of the manual."""
    assert described in DEVICES
    assert (described.kind, described.default_node_id, described.per_wheel) == (kind, node_id, per_wheel)
    assert (described.commanded, described.monitors_master) == (moves, moves)
