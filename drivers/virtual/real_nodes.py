"""What the real nodes on a mixed bench report: the virtual world follows the motors that turn, and the loads that act.

A value is known from a node's TPDO until it has been missing for `MISSING_SYNCS` SYNCs. Units that a device states are
learned while the daemon boots it (`devices.decoding.stated_units`): start the virtual nodes before the daemon.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import Reading, Sync
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import MOTOR_SPEED
from regolithd.drivers.virtual.plant import WHEELS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.virtual.plant import Array

MISSING_SYNCS = 3
"""After so many SYNCs without its TPDO a motor counts as standing still, and a load as unknown."""


class RealNodes:
    """The newest motor speeds and loads that real nodes sent, by wheel."""

    def __init__(self, nodes: Iterable[NodeDescription]) -> None:
        described = tuple(nodes)
        self._decoder = Decoder(described)
        self._wheels = {node.node_id: node.wheel for node in described}
        self._values = {MOTOR_SPEED: np.full(WHEELS, np.nan), LOAD: np.full(WHEELS, np.nan)}
        self._age = {quantity: np.full(WHEELS, MISSING_SYNCS + 1) for quantity in self._values}

    def take(self, frame: Frame) -> None:
        """Take a frame of the bus."""
        if not self._wheels:
            return
        signal = self._decoder.decode(frame)
        if isinstance(signal, Sync):
            for quantity in self._age:
                self._age[quantity] += 1
        elif isinstance(signal, Reading) and (wheel := self._wheels[signal.node_id]) is not None:
            for quantity, value in signal.values:
                if quantity in self._values:
                    self._values[quantity][wheel] = value
                    self._age[quantity][wheel] = 0

    @property
    def motor_speed_rad_s(self) -> Array:
        """Forward positive, shape (6,); NaN where no real motor reports it."""
        return np.where(self._age[MOTOR_SPEED] <= MISSING_SYNCS, self._values[MOTOR_SPEED], np.nan)

    @property
    def load_N(self) -> Array:
        """Shape (6,); NaN where no real load cell reports it."""
        return np.where(self._age[LOAD] <= MISSING_SYNCS, self._values[LOAD], np.nan)
