"""Description of a node that is configured to be on the bus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Device


@dataclass(frozen=True, slots=True)
class NodeDescription:
    """A node: its node-ID, its kind of device, and how it is mounted.

    Attributes
    ----------
    wheel
        0–5 (wheel k of the paper is k − 1), or None for a device of the body.
    required
        Losing it stops the motion, and is an error rather than a warning.
    diagnostics
        Configure its diagnostic TPDOs as well: supply voltage and winding temperature, which not every motor
        controller has as objects.
    mirrored
        A motor that turns backwards, by its own count, when the rover drives forward: its current and speed are
        inverted on reception, its target velocity on transmission.
    serial
        0x1018:04; where given, it must match.
    """

    node_id: int
    device: Device
    wheel: int | None
    required: bool = True
    diagnostics: bool = False
    mirrored: bool = False
    serial: int | None = None

    @property
    def kind(self) -> str:
        """The name of its kind of device."""
        return self.device.kind
