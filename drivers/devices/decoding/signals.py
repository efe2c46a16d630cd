"""What is received from the bus, decoded: SYNC, measurements in SI units, NMT states, emergencies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from regolithd.drivers.canopen.emcy import Emergency

if TYPE_CHECKING:
    from regolithd.drivers.canopen.nmt import NmtState
    from regolithd.drivers.devices.device import Quantity


@dataclass(frozen=True, slots=True)
class Sync:
    """A SYNC seen on the bus: the time of a snapshot. `sent`: the echo of our own."""

    time_ns: int
    sent: bool = False


class Reading(NamedTuple):
    """One TPDO, decoded to SI units. `values` is empty where the node reports that its measurement is not valid.

    A named tuple, because it takes a third of a frozen dataclass's time to make (see `can.frame.Frame`).
    """

    time_ns: int
    node_id: int
    cob_id: int
    values: tuple[tuple[Quantity, float], ...]


@dataclass(frozen=True, slots=True)
class NodeState:
    """A node's heartbeat, or its boot-up message (`NmtState.BOOT_UP`)."""

    time_ns: int
    node_id: int
    state: NmtState


Signal = Sync | Reading | NodeState | Emergency
