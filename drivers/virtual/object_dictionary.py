"""A node's object dictionary while it runs: types, access rights, limits and defaults from the EDS, and its values.

SDO clients use `read` and `write`, which are refused as CiA 301 prescribes. The device itself uses `get` and `put`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING

from canopen.objectdictionary import ODVariable

from regolithd.drivers.canopen.eds import STRUCT_CODES
from regolithd.drivers.canopen.object_dictionary import read_eds
from regolithd.drivers.canopen.sdo_abort import Abort, AbortError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    import canopen

    from regolithd.drivers.devices.virtual.device import Key

Value = int | float | bytes


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry as the EDS describes it. `format` is its struct code; empty for strings and other lengths.

    The values of an entry without struct code are bytes.
    """

    format: str
    readable: bool
    writable: bool
    mappable: bool
    default: Value
    low: int | None
    high: int | None

    @property
    def bits(self) -> int:
        """Its length on the bus; 0 where it has no struct code."""
        return 8 * struct.calcsize(self.format) if self.format else 0


class Dictionary:
    """The objects of one node.

    `on_write` is called with key and value before an SDO client's (or an RPDO's) value is taken, and may raise
    `AbortError`; `after_write` once it is in place.
    """

    def __init__(self, path: Path, node_id: int) -> None:
        self.entries = _entries(path, node_id)
        self.indices = {index for index, _ in self.entries}
        self.values: dict[Key, Value] = {}
        self.on_write: Callable[[Key, int], None] = lambda _key, _value: None
        self.after_write: Callable[[Key, int], None] = lambda _key, _value: None
        self.reset(0x0000, 0xFFFF)

    def reset(self, first: int, last: int) -> None:
        """Give the objects from index `first` to `last` their power-on values."""
        self.values.update({key: entry.default for key, entry in self.entries.items() if first <= key[0] <= last})

    def get(self, index: int, sub: int = 0, missing: int | None = None) -> int:
        """Return an integer, as the device sees it; `missing` where the EDS lists no such object."""
        value = self.values.get((index, sub), missing)
        if value is None:
            raise KeyError(f"0x{index:04X}:{sub:02X}")
        if isinstance(value, bytes):
            raise TypeError(f"0x{index:04X}:{sub:02X} is a string")
        return int(value)

    def put(self, index: int, sub: int, value: float) -> None:
        """Set a number, as the device does: access rights do not apply; a value outside its type's range is clipped.

        An object that the EDS does not list is not set.
        """
        entry = self.entries.get((index, sub))
        if entry is None or not entry.format:
            return
        if entry.format in "fd":
            self.values[index, sub] = float(value)
            return
        value = round(value)
        span = 1 << entry.bits
        lowest = -span // 2 if entry.format.islower() else 0
        self.values[index, sub] = min(max(value, lowest), lowest + span - 1)

    def find(self, key: Key) -> Entry:
        """Return the entry, or abort as for an SDO request (0x06020000, 0x06090011)."""
        entry = self.entries.get(key)
        if entry is None:
            raise AbortError(Abort.NO_SUBINDEX if key[0] in self.indices else Abort.NO_OBJECT)
        return entry

    def read(self, key: Key) -> bytes:
        """Return an entry's bytes for an SDO upload."""
        entry = self.find(key)
        if not entry.readable:
            raise AbortError(Abort.WRITE_ONLY)
        value = self.values[key]
        return value if isinstance(value, bytes) else struct.pack("<" + entry.format, value)

    def check_writable(self, key: Key) -> None:
        """Abort unless an SDO client may write this entry."""
        if not self.find(key).writable:
            raise AbortError(Abort.READ_ONLY)

    def write(self, key: Key, data: bytes) -> None:
        """Take an SDO download's (or RPDO's) bytes: rights, length and limits first, then the device's own rules."""
        self.check_writable(key)
        entry = self.entries[key]
        if not entry.format:
            self.values[key] = bytes(data)
            return
        if 8 * len(data) != entry.bits:
            raise AbortError(Abort.TOO_LONG if 8 * len(data) > entry.bits else Abort.TOO_SHORT)
        (value,) = struct.unpack("<" + entry.format, data)
        if entry.high is not None and value > entry.high:
            raise AbortError(Abort.TOO_HIGH)
        if entry.low is not None and value < entry.low:
            raise AbortError(Abort.TOO_LOW)
        self.on_write(key, value)
        self.values[key] = value
        self.after_write(key, value)


@cache
def _entries(path: Path, node_id: int) -> Mapping[Key, Entry]:
    """Return what the EDS describes; `$NODEID` in a default is the node's."""
    od = read_eds(path, node_id)
    return MappingProxyType({(each.index, each.subindex): _entry(each) for each in _variables(od)})


def _variables(od: canopen.ObjectDictionary) -> Iterator[ODVariable]:
    for entry in od.values():
        if isinstance(entry, ODVariable):
            yield entry
        else:
            yield from entry.values()


def _entry(variable: ODVariable) -> Entry:
    code = STRUCT_CODES.get(variable.data_type or 0, "")
    return Entry(
        format=code,
        readable=variable.readable,
        writable=variable.writable,
        mappable=variable.pdo_mappable,
        default=_default(variable, code),
        low=variable.min,
        high=variable.max,
    )


def _default(variable: ODVariable, code: str) -> Value:
    """Return an entry's power-on value: that of a DCF, the default of the EDS, or 0."""
    value = variable.default if variable.value is None else variable.value
    if code:
        return 0 if value is None else value
    return value if isinstance(value, bytes) else str(value or "").encode("utf-8")
