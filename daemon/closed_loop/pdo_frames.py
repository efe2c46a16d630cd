"""The PDO frames that all nodes send after one SYNC, with measurements rounded to the objects' resolution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen.pdo import Meaning, Validity, tpdos
from regolithd.drivers.signals import Quantity
from regolithd.drivers.virtual.plant import WHEELS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    from regolithd.drivers.signals import NodeDescription
    from regolithd.drivers.virtual.plant import Measurement

    Array = NDArray[np.float64]

SYNC_ID = 0x080
OPERATION_ENABLED = 0x1237
FRAME_NS = 130_000
"""Duration of a full frame on a bus of 1 Mbit/s, stuff bits included."""


def frames(
    nodes: Iterable[NodeDescription], sync_ns: int, motor_speed_rad_s: Array, read: Measurement
) -> Iterator[Frame]:
    """Yield the SYNC and every node's TPDOs, in the order of arbitration (lowest COB-ID first)."""
    known = _quantities(motor_speed_rad_s, read)
    answers = [
        (pdo.cob_id(node.node_id), pdo.pack(*[_raw(meaning, known, node.wheel or 0) for meaning in pdo.meanings]))
        for node in nodes
        for pdo in tpdos(node.kind, diagnostics=node.diagnostics)
    ]
    yield Frame(sync_ns, SYNC_ID, b"", sent=True)
    for place, (can_id, data) in enumerate(sorted(answers), start=1):
        yield Frame(sync_ns + place * FRAME_NS, can_id, data)


def _quantities(motor_speed_rad_s: Array, read: Measurement) -> dict[Quantity, Array]:
    def all_wheels(value: float) -> Array:
        return np.full(WHEELS, value)

    return {
        Quantity.MOTOR_CURRENT: read.motor_current_A,
        Quantity.MOTOR_SPEED: motor_speed_rad_s,
        Quantity.LOAD: read.load_N,
        Quantity.GROUND_SPEED: all_wheels(read.ground_speed_m_s),
        Quantity.PITCH: all_wheels(read.pitch_rad),
        Quantity.ROLL: all_wheels(read.roll_rad),
        Quantity.YAW_RATE: all_wheels(read.yaw_rate_rad_s),
        Quantity.MOTOR_TEMPERATURE: read.motor_temperature_degC,
        Quantity.BUS_VOLTAGE: all_wheels(read.bus_voltage_V),
        Quantity.STATUSWORD: all_wheels(OPERATION_ENABLED),
    }


def _raw(meaning: Meaning | Validity | None, known: Mapping[Quantity, Array], wheel: int) -> int:
    """Return an object's raw value; a validity object is 0 (valid)."""
    return round(known[meaning.quantity][wheel] / meaning.factor) if isinstance(meaning, Meaning) else 0
