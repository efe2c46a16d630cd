"""The configuration that the master writes into a node before it starts it, as a list of writes.

A PDO is set up in CiA 301's order (7.5.2.36): disabled (COB-ID bit 31), its mapping cleared, written and counted, and
enabled last. PDOs that the EDS lists and the master does not use are disabled: a device may have them enabled
by default.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.object_dictionary import object_dictionary, struct_code, variable
from regolithd.drivers.devices.decoding.pdo import rpdos, tpdos

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from regolithd.drivers.canopen.pdo import Pdo
    from regolithd.drivers.devices.node import NodeDescription

SYNC_COB_ID_OBJECT = 0x1005
EMCY_COB_ID_OBJECT = 0x1014
CONSUMER_HEARTBEAT = 0x1016
PRODUCER_HEARTBEAT = 0x1017
PDO_DISABLED = 1 << 31
_NO_REMOTE_REQUEST = 1 << 30  # a device may set this bit by itself
_SYNC_BITS = 0x400007FF  # identifier, and that the node produces no SYNC itself
_EMCY_BITS = 0x800007FF  # identifier, and that it is valid
_PDOS = 512  # of each direction (CiA 301)


@dataclass(frozen=True, slots=True)
class Write:
    """One object to be written and read back; of what is read back, `mask` must equal `value`.

    `keep` reads the value first: one that is correct already is not written, and bits outside `mask` keep the node's
    value. `read_only` is compared, and never written.
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


def boot_writes(
    node: NodeDescription, *, heartbeat_s: float, master_id: int, master_lost_after_s: float
) -> tuple[Write, ...]:
    """Return all writes that configure a node as its description says, in their order."""
    return tuple(_writes(node, heartbeat_s, master_id, master_lost_after_s))


def _writes(node: NodeDescription, heartbeat_s: float, master_id: int, master_lost_after_s: float) -> Iterator[Write]:
    device, eds = node.device, node.device.eds
    used = (*tpdos(device, diagnostics=node.diagnostics), *rpdos(device))
    if SYNC_COB_ID_OBJECT in object_dictionary(eds):
        yield Write(SYNC_COB_ID_OBJECT, 0, cob_id.SYNC, _SYNC_BITS, 4, keep=True)
    if EMCY_COB_ID_OBJECT in object_dictionary(eds):
        yield Write(EMCY_COB_ID_OBJECT, 0, cob_id.EMCY + node.node_id, _EMCY_BITS, 4, keep=True)
    for index in sorted(_listed_pdos(eds) - {pdo.communication_index for pdo in used}):
        yield _disable(index)
    for pdo in used:
        yield from _pdo(eds, pdo, node.node_id)
    for setting in device.settings:
        entry = object_dictionary(eds).get_variable(setting.index, setting.subindex)
        if entry is not None:
            yield replace(_write(eds, setting.index, setting.subindex, setting.value), read_only=not entry.writable)
    if device.monitors_master:
        consumer = master_id << 16 | round(master_lost_after_s * 1000)
        yield _write(eds, CONSUMER_HEARTBEAT, 1, consumer)
    yield _write(eds, PRODUCER_HEARTBEAT, 0, round(heartbeat_s * 1000))


def _listed_pdos(eds: Path) -> set[int]:
    dictionary = object_dictionary(eds)
    return {index for first in (0x1400, 0x1800) for index in range(first, first + _PDOS) if index in dictionary}


def _pdo(eds: Path, pdo: Pdo, node_id: int) -> Iterator[Write]:
    yield _disable(pdo.communication_index)
    yield _write(eds, pdo.communication_index, 2, pdo.transmission_type)
    yield _write(eds, pdo.mapping_index, 0, 0)
    for place, entry in enumerate(pdo.mapping, start=1):
        yield _write(eds, pdo.mapping_index, place, entry)
    yield _write(eds, pdo.mapping_index, 0, len(pdo.mapping))
    yield Write(pdo.communication_index, 1, pdo.cob_id(node_id), ~_NO_REMOTE_REQUEST & 0xFFFFFFFF, 4)


def _disable(index: int) -> Write:
    return Write(index, 1, PDO_DISABLED, PDO_DISABLED, 4, keep=True)


def _write(eds: Path, index: int, subindex: int, value: int) -> Write:
    code = struct_code(variable(eds, index, subindex))
    size = {"b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4}[code]
    return Write(index, subindex, value, (1 << 8 * size) - 1, size, signed=code.islower())
