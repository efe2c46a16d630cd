"""A node's PDOs: mapping and transmission follow the configuration that the master wrote.

Objects (CiA 301, 7.5.2): 0x1400 + k and 0x1600 + k describe RPDO k + 1, 0x1800 + k and 0x1A00 + k TPDO k + 1.
`check` refuses what CiA 301 forbids; `transmit_pdos` and `receive_pdos` compile what is configured, once.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.sdo_abort import Abort, AbortError

if TYPE_CHECKING:
    from regolithd.drivers.devices.virtual.device import Key
    from regolithd.drivers.virtual.object_dictionary import Dictionary

RPDO, RPDO_MAPPING, TPDO, TPDO_MAPPING = 0x1400, 0x1600, 0x1800, 0x1A00
DISABLED = 0x8000_0000  # COB-ID bit 31
_EXTENDED = 0x2000_0000  # COB-ID bit 29: a 29-bit identifier, which these nodes do not have
_COB_ID = 0x7FF
LAST_SYNCHRONOUS = 240
_EVENT_DRIVEN = (254, 255)
_RESERVED_COB_IDS = (
    *(range(0x081), range(0x101, 0x181), range(0x581, 0x600)),
    *(range(0x601, 0x680), range(0x6E0, 0x800)),
)
"""Identifiers that no PDO may use (CiA 301, 7.3.3), and the SYNC's."""


@dataclass(slots=True)
class EnabledPdo:
    """One enabled PDO with at least one mapped object."""

    cob_id: int
    transmission_type: int
    keys: tuple[Key, ...]
    layout: struct.Struct
    inhibit_ns: int = 0
    event_ns: int = 0
    syncs: int = 0  # SYNCs since it was last sent
    sent: bytes | None = None  # data sent last
    sent_ns: int = 0
    received: bytes | None = None  # an RPDO that waits for the next SYNC

    @property
    def synchronous(self) -> bool:
        """Whether a SYNC sends (or applies) it."""
        return self.transmission_type <= LAST_SYNCHRONOUS

    def content(self, dictionary: Dictionary) -> bytes:
        """Return its data with the present values."""
        values = dictionary.values
        return self.layout.pack(*[values[key] for key in self.keys])


def transmit_pdos(dictionary: Dictionary) -> list[EnabledPdo]:
    """Return the TPDOs that are enabled."""
    return _compile(dictionary, TPDO, TPDO_MAPPING)


def receive_pdos(dictionary: Dictionary) -> dict[int, EnabledPdo]:
    """Return the RPDOs that are enabled, by COB-ID."""
    return {pdo.cob_id: pdo for pdo in _compile(dictionary, RPDO, RPDO_MAPPING)}


def concerns_pdos(index: int) -> bool:
    """Whether an object is part of the PDOs' configuration."""
    return RPDO <= index < TPDO_MAPPING + 0x200


def usable(cob_id: int) -> bool:
    """Whether a PDO or an EMCY may have this COB-ID (bit 31, enabling it or not, apart)."""
    reserved = any((cob_id & _COB_ID) in cob_ids for cob_ids in _RESERVED_COB_IDS)
    return not reserved and not cob_id & _EXTENDED


def moved_while_enabled(before: int, after: int) -> bool:
    """Whether a COB-ID would change its identifier while bit 31 says that its service is in use (CiA 301, 7.5.2.17)."""
    return not (before | after) & DISABLED and bool((before ^ after) & _COB_ID)


def check(dictionary: Dictionary, key: Key, value: int) -> None:
    """Abort a write to a PDO's configuration that CiA 301 forbids."""
    index, sub = key
    part, number = index & ~0x1FF, index & 0x1FF
    if part in {RPDO, TPDO}:
        _check_communication(dictionary, key, value, transmit=part == TPDO)
    elif part in {RPDO_MAPPING, TPDO_MAPPING}:
        transmit = part == TPDO_MAPPING
        cob_id = ((TPDO if transmit else RPDO) + number, 1)
        if not dictionary.get(*cob_id) & DISABLED and dictionary.entries[cob_id].writable:
            raise AbortError(Abort.UNSUPPORTED_ACCESS)
        if sub == 0:
            _check_mapping(dictionary, index, value, transmit=transmit)
        elif dictionary.get(index, 0):
            raise AbortError(Abort.UNSUPPORTED_ACCESS)
        elif value:
            _mapped(dictionary, value, transmit=transmit)


def _compile(dictionary: Dictionary, communication: int, mapping: int) -> list[EnabledPdo]:
    pdos = []
    for number in range(0x200):
        mandatory = {(communication + number, 1), (communication + number, 2), (mapping + number, 0)}
        if not mandatory <= dictionary.entries.keys():
            continue
        cob_id = dictionary.get(communication + number, 1)
        count = dictionary.get(mapping + number, 0)
        if cob_id & DISABLED or not count:
            continue
        keys = tuple(_split(dictionary.get(mapping + number, sub))[0] for sub in range(1, count + 1))
        layout = struct.Struct("<" + "".join(dictionary.entries[key].format for key in keys))
        pdo = EnabledPdo(cob_id & _COB_ID, dictionary.get(communication + number, 2), keys, layout)
        if communication == TPDO and not pdo.synchronous:  # CiA 301, 7.5.2.37: both are for event-driven TPDOs
            pdo.inhibit_ns = dictionary.get(communication + number, 3, missing=0) * 100_000
            pdo.event_ns = dictionary.get(communication + number, 5, missing=0) * 1_000_000
        pdos.append(pdo)
    return pdos


def _split(mapping: int) -> tuple[Key, int]:
    """Return the object of a mapping entry, and its length in bits."""
    return (mapping >> 16, mapping >> 8 & 0xFF), mapping & 0xFF


def _mapped(dictionary: Dictionary, mapping: int, *, transmit: bool) -> int:
    """Return a mapping entry's length in bits, or abort where it cannot be mapped."""
    key, bits = _split(mapping)
    entry = dictionary.find(key)
    allowed = entry.readable if transmit else entry.writable
    if not (entry.mappable and allowed and bits == entry.bits):
        raise AbortError(Abort.NOT_MAPPABLE)
    return bits


def _check_mapping(dictionary: Dictionary, index: int, count: int, *, transmit: bool) -> None:
    if count > 8:
        raise AbortError(Abort.PDO_LENGTH)
    mappings = [dictionary.get(index, sub) for sub in range(1, count + 1)]
    if sum(_mapped(dictionary, mapping, transmit=transmit) for mapping in mappings) > 64:
        raise AbortError(Abort.PDO_LENGTH)


def _check_communication(dictionary: Dictionary, key: Key, value: int, *, transmit: bool) -> None:
    index, sub = key
    before = dictionary.get(index, 1)
    enabled = not before & DISABLED
    if sub == 1 and not value & DISABLED and (moved_while_enabled(before, value) or not usable(value)):
        raise AbortError(Abort.INVALID_VALUE)
    if sub == 2 and value > LAST_SYNCHRONOUS and value not in _EVENT_DRIVEN:
        raise AbortError(Abort.INVALID_VALUE)  # reserved, or by remote request, which these nodes do not serve
    if sub == 3 and transmit and enabled:
        raise AbortError(Abort.INVALID_VALUE)
