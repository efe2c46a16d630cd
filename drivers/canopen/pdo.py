"""Process data objects (CiA 301, 7.2.2): which objects travel in which PDO, and in which bytes.

Which objects share a PDO is the master's choice. Sizes and types come from the node's EDS, and every mapping is checked
against it: each object exists, may be mapped, and all fit into 8 bytes. One struct per PDO is compiled once; decoding a
frame is then one `unpack` and a few multiplications.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.object_dictionary import struct_code, variable
from regolithd.drivers.errors import DictionaryError

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

MAX_BYTES = 8


@dataclass(frozen=True, slots=True)
class Pdo:
    """One PDO, compiled: its number (from 1), its mapping parameters and its struct.

    `transmit` is seen from the node; `mapping` holds the values of 0x1600/0x1A00: index << 16 | subindex << 8 | bits.
    """

    number: int
    transmit: bool
    transmission_type: int
    mapping: tuple[int, ...]
    layout: struct.Struct = field(compare=False)

    @property
    def communication_index(self) -> int:
        """Index of its communication parameters (0x1400… or 0x1800…)."""
        return (0x1800 if self.transmit else 0x1400) + self.number - 1

    @property
    def mapping_index(self) -> int:
        """Index of its mapping parameters (0x1600… or 0x1A00…)."""
        return (0x1A00 if self.transmit else 0x1600) + self.number - 1

    def cob_id(self, node_id: int) -> int:
        """Return its COB-ID in the predefined connection set."""
        return (cob_id.TPDO if self.transmit else cob_id.RPDO) + cob_id.PDO_STEP * (self.number - 1) + node_id

    def pack(self, *values: int) -> bytes:
        """Return the frame's data for raw values, one per mapped object."""
        return self.layout.pack(*values)


def compile_mapping(
    eds: Path, number: int, objects: Iterable[tuple[int, int]]
) -> tuple[tuple[int, ...], struct.Struct]:
    """Return the mapping parameters and the struct of a PDO that carries these objects (index, subindex).

    Raises
    ------
    DictionaryError
        The EDS lacks an object or says that it may not be mapped, or all together exceed 8 bytes.
    """
    codes, mapping = [], []
    for index, subindex in objects:
        entry = variable(eds, index, subindex)
        if not entry.pdo_mappable:
            raise DictionaryError("may not be mapped to a PDO, according to the EDS", index=index, subindex=subindex)
        code = struct_code(entry)
        codes.append(code)
        mapping.append(index << 16 | subindex << 8 | 8 * struct.calcsize("<" + code))
    compiled = struct.Struct("<" + "".join(codes))
    if compiled.size > MAX_BYTES:
        raise DictionaryError(f"PDO {number} of {eds.name} has {compiled.size} bytes; a frame carries 8")
    return tuple(mapping), compiled
