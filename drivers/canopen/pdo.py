"""Process data objects (CiA 301, 7.2.2): which objects travel in which PDO, and what their bytes are in SI.

The layout – which object in which PDO – is the master's to choose and is written here. Sizes and types of the objects
come from the node's EDS, and every layout is checked against it: each object exists, may be mapped, and all fit into
8 bytes. One struct per PDO is compiled once; decoding a frame is then one `unpack` and a few multiplications.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field
from functools import cache

from regolithd.drivers.canopen.object_dictionary import struct_code, variable
from regolithd.drivers.errors import DictionaryError
from regolithd.drivers.signals import NodeKind, Quantity

MAX_BYTES = 8
SYNCHRONOUS = 1  # transmission type: at every SYNC
EVENT_DRIVEN = 255  # at once

# Predefined connection set (CiA 301, 7.3.3): COB-ID of the first TPDO and RPDO, and the step to the next.
TPDO_BASE = 0x180
RPDO_BASE = 0x200
PDO_STEP = 0x100

_RAD_S_PER_RPM = 2.0 * math.pi / 60.0
_RAD_PER_CENTIDEGREE = math.radians(0.01)


@dataclass(frozen=True, slots=True)
class Meaning:
    """What an object's raw value says: `quantity` = raw × `factor`, in the quantity's SI unit."""

    quantity: Quantity
    factor: float


@dataclass(frozen=True, slots=True)
class Validity:
    """A status object: where raw & `mask` is not 0, what else this PDO carries has not been measured."""

    mask: int


# (kind, index, subindex) → what it means. Units as the EDS files say.
MEANINGS: dict[tuple[NodeKind, int, int], Meaning | Validity] = {
    (NodeKind.MOTOR, 0x6041, 0): Meaning(Quantity.STATUSWORD, 1.0),
    (NodeKind.MOTOR, 0x6078, 0): Meaning(Quantity.MOTOR_CURRENT, 1e-3),  # mA
    (NodeKind.MOTOR, 0x2027, 0): Meaning(Quantity.MOTOR_CURRENT, 1e-3),  # mA, averaged by the controller
    (NodeKind.MOTOR, 0x606C, 0): Meaning(Quantity.MOTOR_SPEED, _RAD_S_PER_RPM),
    (NodeKind.MOTOR, 0x2028, 0): Meaning(Quantity.MOTOR_SPEED, _RAD_S_PER_RPM),  # averaged by the controller
    (NodeKind.MOTOR, 0x6079, 0): Meaning(Quantity.BUS_VOLTAGE, 1e-3),  # mV
    (NodeKind.MOTOR, 0x2F00, 0): Meaning(Quantity.MOTOR_TEMPERATURE, 0.1),  # 0.1 °C
    (NodeKind.LOAD_CELL, 0x9130, 1): Meaning(Quantity.LOAD, 1e-2),  # 0.01 N
    (NodeKind.LOAD_CELL, 0x6150, 1): Validity(0b111),  # CiA 404: not valid, positive overload, negative overload
    (NodeKind.INCLINOMETER, 0x6010, 0): Meaning(Quantity.PITCH, _RAD_PER_CENTIDEGREE),
    (NodeKind.INCLINOMETER, 0x6020, 0): Meaning(Quantity.ROLL, _RAD_PER_CENTIDEGREE),
    (NodeKind.INCLINOMETER, 0x2010, 0): Meaning(Quantity.YAW_RATE, _RAD_PER_CENTIDEGREE),
    (NodeKind.GROUND_SPEED, 0x2100, 0): Meaning(Quantity.GROUND_SPEED, 1e-5),  # 0.01 mm/s
    (NodeKind.GROUND_SPEED, 0x2102, 0): Validity(0b1),
}


# What has the sign of a motor's own direction, which is the other way round where it is mounted mirrored.
DIRECTED = (Quantity.MOTOR_CURRENT, Quantity.MOTOR_SPEED)


@dataclass(frozen=True, slots=True)
class Layout:
    """What the master wants in one PDO. `number` counts from 1; `entries` are (index, subindex) in their order."""

    number: int
    entries: tuple[tuple[int, int], ...]
    transmission_type: int = SYNCHRONOUS
    diagnostic: bool = False  # only where the node's description asks for it


TPDO_LAYOUTS: dict[NodeKind, tuple[Layout, ...]] = {
    NodeKind.MOTOR: (
        Layout(1, ((0x6041, 0), (0x6078, 0), (0x606C, 0))),
        Layout(2, ((0x6079, 0), (0x2F00, 0)), diagnostic=True),
    ),
    NodeKind.LOAD_CELL: (Layout(1, ((0x9130, 1), (0x6150, 1))),),
    NodeKind.INCLINOMETER: (Layout(1, ((0x6010, 0), (0x6020, 0), (0x2010, 0))),),
    NodeKind.GROUND_SPEED: (Layout(1, ((0x2100, 0), (0x2102, 0))),),
}
# Commands act at once: a quick stop must not wait for a SYNC, nor be lost with it.
RPDO_LAYOUTS: dict[NodeKind, tuple[Layout, ...]] = {
    NodeKind.MOTOR: (Layout(1, ((0x6040, 0), (0x60FF, 0)), EVENT_DRIVEN),),
}


@dataclass(frozen=True, slots=True)
class Pdo:
    """One PDO, compiled: its place on the bus, its mapping objects' values, and its struct."""

    number: int
    transmit: bool  # seen from the node
    transmission_type: int
    mapping: tuple[int, ...]  # values for 0x1600/0x1A00: index << 16 | subindex << 8 | bits
    meanings: tuple[Meaning | Validity | None, ...]
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
        return (TPDO_BASE if self.transmit else RPDO_BASE) + PDO_STEP * (self.number - 1) + node_id

    def pack(self, *values: int) -> bytes:
        """Return the frame's data for raw values, one per mapped object."""
        return self.layout.pack(*values)


@cache
def tpdos(kind: NodeKind, *, diagnostics: bool = False) -> tuple[Pdo, ...]:
    """Return the TPDOs that a node of this kind is configured to send."""
    layouts = TPDO_LAYOUTS[kind]
    return tuple(_compile(kind, layout, transmit=True) for layout in layouts if diagnostics or not layout.diagnostic)


@cache
def rpdos(kind: NodeKind) -> tuple[Pdo, ...]:
    """Return the RPDOs that a node of this kind is configured to obey."""
    return tuple(_compile(kind, layout, transmit=False) for layout in RPDO_LAYOUTS.get(kind, ()))


def _compile(kind: NodeKind, layout: Layout, *, transmit: bool) -> Pdo:
    codes, mapping, meanings = [], [], []
    for index, subindex in layout.entries:
        entry = variable(kind, index, subindex)
        if not entry.pdo_mappable:
            raise DictionaryError("may not be mapped to a PDO, says the EDS", index=index, subindex=subindex)
        code = struct_code(entry)
        codes.append(code)
        mapping.append(index << 16 | subindex << 8 | 8 * struct.calcsize("<" + code))
        meanings.append(MEANINGS.get((kind, index, subindex)))
    compiled = struct.Struct("<" + "".join(codes))
    if compiled.size > MAX_BYTES:
        raise DictionaryError(f"PDO {layout.number} of {kind.value} nodes has {compiled.size} bytes; a frame carries 8")
    return Pdo(layout.number, transmit, layout.transmission_type, tuple(mapping), tuple(meanings), compiled)
