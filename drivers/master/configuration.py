"""What the master writes into a node before it starts it, as a list of writes – so that it can be read and tested.

A PDO is set up in CiA 301's order (7.5.2.36): switched off (COB-ID bit 31), its mapping emptied, filled and counted,
and switched on last. PDOs that the EDS lists and nobody here uses are switched off: a device may have them on by
default.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.decoder import SYNC_COB_ID
from regolithd.drivers.canopen.emcy import EMCY_COB_ID
from regolithd.drivers.canopen.object_dictionary import object_dictionary, struct_code, variable
from regolithd.drivers.canopen.pdo import Pdo, rpdos, tpdos
from regolithd.drivers.devices.cia402 import PROFILE_VELOCITY
from regolithd.drivers.signals import NodeKind

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.drivers.signals import NodeDescription

SYNC_COB_ID_OBJECT = 0x1005
EMCY_COB_ID_OBJECT = 0x1014
CONSUMER_HEARTBEAT = 0x1016
PRODUCER_HEARTBEAT = 0x1017
PDO_OFF = 1 << 31
_NO_REMOTE_REQUEST = 1 << 30  # a device may set it by itself
_SYNC_BITS = 0x400007FF  # identifier, and that the node produces no SYNC itself
_EMCY_BITS = 0x800007FF  # identifier, and that it is valid
_PDOS = 512  # of each direction (CiA 301)

# What else a kind of node must be told, or must be: (index, subindex, value). What its EDS lacks is left out; what it
# says cannot be written is only compared, because a wrong unit would be a wrong measurement that looks right.
_SETTINGS: dict[NodeKind, tuple[tuple[int, int, int], ...]] = {
    NodeKind.MOTOR: (
        (0x6060, 0, PROFILE_VELOCITY),  # modes of operation
        (0x6007, 0, 3),  # on the master's loss: quick stop
        (0x605A, 0, 2),  # quick stop: brake with the quick-stop ramp, then switch-on disabled
    ),
    NodeKind.LOAD_CELL: (
        (0x6112, 1, 1),  # operating mode: on
        (0x6131, 1, 0x00210000),  # unit of the process value (CiA 303-2): newton
        (0x6132, 1, 2),  # decimal digits: 0.01 N
    ),
    NodeKind.INCLINOMETER: ((0x6000, 0, 10),),  # resolution: 0.01°
}


@dataclass(frozen=True, slots=True)
class Write:
    """One object to be written and read back; of what is read back, `mask` must equal `value`.

    `keep` reads the value first: what is right already is not written, and bits outside `mask` stay as the node has
    them. `read_only` is compared, and never written.
    """

    index: int
    subindex: int
    value: int
    mask: int
    size: int  # bytes
    signed: bool = False
    keep: bool = False
    read_only: bool = False

    def data(self, present: int = 0) -> bytes:
        """Return the bytes to write, where the node has `present`."""
        value = self.value | (present & ~self.mask) if self.keep else self.value
        return value.to_bytes(self.size, "little", signed=self.signed)


def configuration(
    node: NodeDescription, *, heartbeat_s: float, master_id: int, master_lost_after_s: float
) -> tuple[Write, ...]:
    """Return all writes that make a node what its description says, in their order."""
    return tuple(_writes(node, heartbeat_s, master_id, master_lost_after_s))


def _writes(node: NodeDescription, heartbeat_s: float, master_id: int, master_lost_after_s: float) -> Iterator[Write]:
    kind = node.kind
    used = (*tpdos(kind, diagnostics=node.diagnostics), *rpdos(kind))
    if SYNC_COB_ID_OBJECT in object_dictionary(kind):
        yield Write(SYNC_COB_ID_OBJECT, 0, SYNC_COB_ID, _SYNC_BITS, 4, keep=True)
    if EMCY_COB_ID_OBJECT in object_dictionary(kind):
        yield Write(EMCY_COB_ID_OBJECT, 0, EMCY_COB_ID + node.node_id, _EMCY_BITS, 4, keep=True)
    for index in sorted(_listed_pdos(kind) - {pdo.communication_index for pdo in used}):
        yield _switch_off(index)
    for pdo in used:
        yield from _pdo(kind, pdo, node.node_id)
    for index, subindex, value in _SETTINGS.get(kind, ()):
        entry = object_dictionary(kind).get_variable(index, subindex)
        if entry is not None:
            yield replace(_write(kind, index, subindex, value), read_only=not entry.writable)
    if kind is NodeKind.MOTOR:
        consumer = master_id << 16 | round(master_lost_after_s * 1000)
        yield _write(kind, CONSUMER_HEARTBEAT, 1, consumer)
    yield _write(kind, PRODUCER_HEARTBEAT, 0, round(heartbeat_s * 1000))


def _listed_pdos(kind: NodeKind) -> set[int]:
    dictionary = object_dictionary(kind)
    return {index for first in (0x1400, 0x1800) for index in range(first, first + _PDOS) if index in dictionary}


def _pdo(kind: NodeKind, pdo: Pdo, node_id: int) -> Iterator[Write]:
    yield _switch_off(pdo.communication_index)
    yield _write(kind, pdo.communication_index, 2, pdo.transmission_type)
    yield _write(kind, pdo.mapping_index, 0, 0)
    for place, entry in enumerate(pdo.mapping, start=1):
        yield _write(kind, pdo.mapping_index, place, entry)
    yield _write(kind, pdo.mapping_index, 0, len(pdo.mapping))
    yield Write(pdo.communication_index, 1, pdo.cob_id(node_id), ~_NO_REMOTE_REQUEST & 0xFFFFFFFF, 4)


def _switch_off(index: int) -> Write:
    return Write(index, 1, PDO_OFF, PDO_OFF, 4, keep=True)


def _write(kind: NodeKind, index: int, subindex: int, value: int) -> Write:
    code = struct_code(variable(kind, index, subindex))
    size = {"b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4}[code]
    return Write(index, subindex, value, (1 << 8 * size) - 1, size, signed=code.islower())
