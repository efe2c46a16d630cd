"""The PDO frames that all nodes send after one SYNC, with measurements rounded to the objects' resolution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import cob_id
from regolithd.drivers.devices.decoding.pdo import tpdos
from regolithd.drivers.devices.device import Measured
from regolithd.drivers.devices.ground_speed import GROUND_SPEED
from regolithd.drivers.devices.inclinometer import PITCH, ROLL, YAW_RATE
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import (
    BUS_VOLTAGE,
    MOTOR_CURRENT,
    MOTOR_SPEED,
    MOTOR_TEMPERATURE,
    STATUSWORD,
)
from regolithd.drivers.virtual.plant import WHEELS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    from regolithd.drivers.devices.device import PdoObject, Quantity
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.virtual.plant import Measurement

    Array = NDArray[np.float64]

OPERATION_ENABLED = 0x1237
FRAME_NS = 130_000
"""Duration of a full frame on a bus of 1 Mbit/s, stuff bits included."""


def frames(
    nodes: Iterable[NodeDescription], sync_ns: int, motor_speed_rad_s: Array, read: Measurement
) -> Iterator[Frame]:
    """Yield the SYNC and every node's TPDOs, in the order of arbitration (lowest COB-ID first)."""
    known = _quantities(motor_speed_rad_s, read)
    answers = [
        (pdo.cob_id(node.node_id), pdo.pack(*[_raw(each, known, node.wheel or 0) for each in pdo.objects]))
        for node in nodes
        for pdo in tpdos(node.device, diagnostics=node.diagnostics)
    ]
    yield Frame(sync_ns, cob_id.SYNC, b"", sent=True)
    for place, (can_id, data) in enumerate(sorted(answers), start=1):
        yield Frame(sync_ns + place * FRAME_NS, can_id, data)


def _quantities(motor_speed_rad_s: Array, read: Measurement) -> dict[Quantity, Array]:
    def all_wheels(value: float) -> Array:
        return np.full(WHEELS, value)

    return {
        MOTOR_CURRENT: read.motor_current_A,
        MOTOR_SPEED: motor_speed_rad_s,
        LOAD: read.load_N,
        GROUND_SPEED: all_wheels(read.ground_speed_m_s),
        PITCH: all_wheels(read.pitch_rad),
        ROLL: all_wheels(read.roll_rad),
        YAW_RATE: all_wheels(read.yaw_rate_rad_s),
        MOTOR_TEMPERATURE: read.motor_temperature_degC,
        BUS_VOLTAGE: all_wheels(read.bus_voltage_V),
        STATUSWORD: all_wheels(OPERATION_ENABLED),
    }


def _raw(mapped: PdoObject, known: Mapping[Quantity, Array], wheel: int) -> int:
    """Return an object's raw value; a validity object is 0 (valid), and so is a quantity that is not simulated."""
    if not isinstance(mapped, Measured) or mapped.quantity not in known:
        return 0
    return round(known[mapped.quantity][wheel] / mapped.scale)
