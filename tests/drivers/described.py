"""Devices composed from profiles for tests, and the makers' EDS files where somebody has them."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.devices.profiles.choice import DeviceChoice, Placement
from regolithd.drivers.devices.profiles.compose import compose

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Device

MAKERS = {
    "MaxonEPOS2.eds": DeviceChoice("epos2"),
    "MaxonEPOS4.eds": DeviceChoice("epos4"),
    "cob_ElmoSimplIQ.dcf": DeviceChoice(
        "cia402",
        placements=(
            Placement("motor_speed_rad_s", unit="rpm"),
            Placement("motor_current_A", unit="mA"),
        ),
    ),
}
"""Names of makers' files, which are not ours to distribute, and the choices that fit them."""


def described(kind: Device, choice: DeviceChoice) -> Device:
    """Return the device that a choice describes; fail with every reason why there is none."""
    device, problems = compose(kind, choice)
    assert device is not None, "\n".join(map(str, problems))
    return device


def makers() -> dict[str, DeviceChoice]:
    """Return the choices of the makers' files that lie in the folder REGOLITHD_EDS_FOLDER, if it is set."""
    folder = Path(os.environ.get("REGOLITHD_EDS_FOLDER", os.devnull))
    return {name: replace(choice, eds=folder / name) for name, choice in MAKERS.items() if (folder / name).is_file()}


def motor(choice: DeviceChoice, node_id: int = 3, wheel: int = 2) -> NodeDescription:
    """Return a node with this motor controller."""
    return NodeDescription(node_id, described(MOTOR_CONTROLLER, choice), wheel)


def load_cell(choice: DeviceChoice, node_id: int = 14, wheel: int = 3) -> NodeDescription:
    """Return a node with this load cell."""
    return NodeDescription(node_id, described(LOAD_CELL, choice), wheel)
