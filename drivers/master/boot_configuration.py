"""The configuration that the master writes into a node before it starts it, as a list of writes.

A PDO is set up in CiA 301's order (7.5.2.36): disabled (COB-ID bit 31), its mapping cleared, written and counted, and
enabled last. PDOs that the EDS lists and the master does not use are disabled: a device may have them enabled
by default.

What the EDS says cannot be written is compared instead. An identifier (COB-ID) is only changed while its service is
switched off: EMCY by bit 31 of 0x1014, the production of SYNC by bit 30 of 0x1005 (CiA 301, 7.5.2.5 and 7.5.2.17).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.object_dictionary import (
    known_variable,
    object_dictionary,
    struct_code,
    variable,
    writable,
)
from regolithd.drivers.devices.decoding.pdo import rpdos, tpdos
from regolithd.drivers.errors import DictionaryError

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
_PDO_BITS = ~_NO_REMOTE_REQUEST & 0xFFFFFFFF
_PRODUCES_SYNC = 1 << 30  # of 0x1005
_IDENTIFIER = 0x7FF
_SYNC_BITS = 0x400007FF  # identifier, and that the node produces no SYNC itself
_EMCY_BITS = 0x800007FF  # identifier, and that it is valid
_PDOS = 512  # of each direction (CiA 301)


@dataclass(frozen=True, slots=True)
class Write:
    """One object to be written and read back; of what is read back, `mask` must equal `value`.

    `keep` reads the value first: one that is correct already is not written, and bits outside `mask` keep the node's
    value. `read_only` is compared, and never written. `lock`: the bit that must have this value (mask, value) before
    the identifier in the object may be changed.
    """

    index: int
    subindex: int
    value: int
    mask: int
    size: int  # bytes
    signed: bool = False
    keep: bool = False
    read_only: bool = False
    lock: tuple[int, int] | None = None

    def data(self, present: int = 0) -> bytes:
        """Return the bytes to write, where the node has `present`."""
        value = self.value | (present & ~self.mask) if self.keep else self.value
        return value.to_bytes(self.size, "little", signed=self.signed)

    def steps(self, present: int) -> Iterator[bytes]:
        """Yield the bytes to write one after the other, where the node has `present`."""
        if self.lock is not None:
            bit, wanted = self.lock
            moved = (present ^ self.value) & _IDENTIFIER
            if moved and present & bit != wanted:
                yield (present & ~bit | wanted).to_bytes(self.size, "little")
        yield self.data(present)

    def difference(self, present: int) -> str:
        """Return in words that the node has `present` instead of the value."""
        done = "cannot be written, must be" if self.read_only else "was set to"
        return f"{done} 0x{self.value & self.mask:X}, and reads 0x{present & self.mask:X}"


def boot_writes(
    node: NodeDescription, *, heartbeat_s: float, master_id: int, master_lost_after_s: float
) -> tuple[Write, ...]:
    """Return all writes that configure a node as its description says, in their order.

    Raises
    ------
    DictionaryError
        Its EDS lacks an object that is needed, or does not allow a PDO.
    """
    return tuple(_writes(node, heartbeat_s, master_id, master_lost_after_s))


def monitors_master(node: NodeDescription) -> bool:
    """Return whether the node will notice when the master's heartbeat stops (0x1016 is optional in CiA 301)."""
    return node.device.monitors_master and writable(node.device.eds, CONSUMER_HEARTBEAT, 1)


def _writes(node: NodeDescription, heartbeat_s: float, master_id: int, master_lost_after_s: float) -> Iterator[Write]:
    device, eds = node.device, node.device.eds
    used = (*tpdos(device, diagnostics=node.diagnostics), *rpdos(device))
    yield from _sync_and_emergency(eds, node.node_id)
    for index in sorted(_listed_pdos(eds) - {pdo.communication_index for pdo in used}):
        if writable(eds, index, 1):
            yield _disable(index)
    for pdo in used:
        yield from _pdo(eds, pdo, node.node_id)
    for setting in device.settings:
        if known_variable(eds, setting.index, setting.subindex) is not None:
            yield _write(eds, setting.index, setting.subindex, setting.value)
    if monitors_master(node):
        consumer = master_id << 16 | round(master_lost_after_s * 1000)
        yield _write(eds, CONSUMER_HEARTBEAT, 1, consumer)
    yield _write(eds, PRODUCER_HEARTBEAT, 0, round(heartbeat_s * 1000))


def _sync_and_emergency(eds: Path, node_id: int) -> Iterator[Write]:
    for index, value, mask, lock in (
        (SYNC_COB_ID_OBJECT, cob_id.SYNC, _SYNC_BITS, (_PRODUCES_SYNC, 0)),
        (EMCY_COB_ID_OBJECT, cob_id.EMCY + node_id, _EMCY_BITS, (PDO_DISABLED, PDO_DISABLED)),
    ):
        if index in object_dictionary(eds):
            yield Write(index, 0, value, mask, 4, keep=True, read_only=not writable(eds, index), lock=lock)


def _listed_pdos(eds: Path) -> set[int]:
    dictionary = object_dictionary(eds)
    return {index for first in (0x1400, 0x1800) for index in range(first, first + _PDOS) if index in dictionary}


def _pdo(eds: Path, pdo: Pdo, node_id: int) -> Iterator[Write]:
    communication, mapping = pdo.communication_index, pdo.mapping_index
    movable = writable(eds, communication, 1)
    if movable:
        yield _disable(communication)
    yield _write(eds, communication, 2, pdo.transmission_type)
    if writable(eds, mapping, 0):
        yield _write(eds, mapping, 0, 0)
    for place, entry in enumerate(pdo.mapping, start=1):
        yield _write(eds, mapping, place, entry)
    yield _write(eds, mapping, 0, len(pdo.mapping))
    yield Write(communication, 1, pdo.cob_id(node_id), _PDO_BITS, 4, read_only=not movable)


def _disable(index: int) -> Write:
    return Write(index, 1, PDO_DISABLED, PDO_DISABLED, 4, keep=True)


def _write(eds: Path, index: int, subindex: int, value: int) -> Write:
    entry = variable(eds, index, subindex)
    code = struct_code(entry)
    if code in "fd":
        raise DictionaryError("holds no integer, and cannot be configured", index=index, subindex=subindex)
    size = struct.calcsize("<" + code)
    mask = (1 << 8 * size) - 1
    low, high = (-(mask + 1) // 2, mask // 2) if code.islower() else (0, mask)
    if not low <= value <= high:
        what = f"cannot be set to {value}: its type goes from {low} to {high}"
        raise DictionaryError(what, index=index, subindex=subindex, remedy="Correct the value in [devices]")
    return Write(index, subindex, value, mask, size, signed=code.islower(), read_only=not entry.writable)
