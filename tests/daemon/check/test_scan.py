"""What `regolithd scan` says of each node."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from typer.testing import CliRunner

from regolithd.daemon.check.scan import describe
from regolithd.daemon.cli import app
from regolithd.daemon.config.configuration import Configuration
from regolithd.drivers.canopen.nmt import NmtState
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.devices.profiles.identity import identity_entries
from regolithd.drivers.devices.registry import DEVICES
from regolithd.drivers.master.events import Identity
from regolithd.drivers.master.survey import FoundNode

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Device


def found(device_type: int, vendor: int = 0x9A, revision: int = 1, **fields: object) -> FoundNode:
    """Return a node with this identity."""
    return FoundNode(5, Identity(device_type, vendor, 7, revision, 1), **fields)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("node", "needs"),
    [
        (found(0x20192), 'It would need its id in [nodes] motors and [devices.5] profile = "cia402"'),
        (found(0x20192, 0xFB, 0x0150_0000), 'It would need its id in [nodes] motors and [devices.5] profile = "epos4"'),
        (found(0x20192, 0xFB, 0x2122_0000), 'It would need its id in [nodes] motors and [devices.5] profile = "epos2"'),
        (found(0x20194), 'It would need its id in [nodes] load_cells and [devices.5] profile = "cia404"'),
        (found(0x4019A), "It would need its id in [nodes] inclinometer"),
        (found(0x00196), "No profile of regolithd fits: describe its objects in [devices.5]"),
        (found(0x20194, shared=True), "Two nodes answer with this id: switch one off, and give it another"),
        (FoundNode(5), "It sends, and does not answer: reset it, or look for a second node with its id"),
    ],
)
def test_each_node_is_told_what_it_would_need(node: FoundNode, needs: str) -> None:
    """The device profile and the maker decide the line in `rover.toml`."""
    assert describe(node, None, known=False).needs == needs


@pytest.mark.parametrize("device", DEVICES, ids=lambda device: device.kind)
def test_a_device_that_comes_with_regolithd_needs_no_table_of_its_own(device: Device) -> None:
    """They are what [nodes] means without [devices]; the ground-speed sensor has no CiA profile."""
    known = identity_entries(device)
    node = FoundNode(5, Identity(known[0], known[1], known[2], known[3], 1))
    assert describe(node, None, known=False).needs == f"It would need its id in [nodes] {device.configuration_key}"


def test_a_configured_node_is_compared() -> None:
    """A drive with the node-ID of a load cell is named; a node that is in no list is said to be absent there."""
    cell = NodeDescription(5, LOAD_CELL, 0)
    assert describe(found(0x20192), cell, known=True).needs.startswith("its device type is 0x00020192, expected")
    assert describe(found(0x20192), None, known=True).needs.startswith("not in [nodes]. ")


def test_state_errors_and_identity_are_in_words() -> None:
    """The error history has codes with texts, the newest first; a node without heartbeat is no fault."""
    node = found(0x20192, error_register=0x05, errors=(0x3220, 0x8130), nmt_state=NmtState.OPERATIONAL, name="EPOS4")
    told = describe(node, None, known=False)
    assert told.device == "EPOS4 drive CiA 402"
    assert told.state == "operational"
    assert told.errors.startswith("generic, voltage – 0x3220 ")
    assert "; 0x8130 " in told.errors
    assert told.identity == "vendor 0x9A, product 0x00000007, revision 0x00000001, serial 0x1"
    assert describe(found(0x20192), None, known=False).state == "no heartbeat"


def test_a_bus_that_cannot_be_opened_is_one_error() -> None:
    """Exit status 1, and the driver's text; no traceback."""
    done = CliRunner().invoke(app, ["scan", "--channel", "absent0"])
    assert done.exit_code == 1
    assert isinstance(done.exception, SystemExit)
    assert Configuration().bus.channel == "can0"
