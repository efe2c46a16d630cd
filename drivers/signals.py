"""What the nodes on the bus are, what they measure, and what they say – decoded, in SI units.

This is the drivers' public vocabulary: everything past it speaks of quantities, never of objects or bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from regolithd.drivers.canopen.nmt import NmtState


class NodeKind(StrEnum):
    """A node's device profile."""

    MOTOR = "motor"  # CiA 402, EPOS-24/1-like
    LOAD_CELL = "load-cell"  # CiA 404
    INCLINOMETER = "inclinometer"  # CiA 410
    GROUND_SPEED = "ground-speed"


class Quantity(StrEnum):
    """A measured quantity; the value is its column name in recordings and messages, unit included."""

    MOTOR_CURRENT = "motor_current_A"
    MOTOR_SPEED = "motor_speed_rad_s"
    LOAD = "load_N"
    GROUND_SPEED = "ground_speed_m_s"
    PITCH = "pitch_rad"
    ROLL = "roll_rad"
    YAW_RATE = "yaw_rate_rad_s"
    MOTOR_TEMPERATURE = "motor_temperature_degC"
    BUS_VOLTAGE = "bus_voltage_V"
    STATUSWORD = "statusword"


@dataclass(frozen=True, slots=True)
class NodeDescription:
    """A node that the configuration says is on the bus. `wheel` is 0–5 (wheel k of the paper is k − 1), else None.

    `diagnostics` asks a motor controller for TPDO 2 as well: supply voltage and winding temperature, which not every
    controller has as objects. `mirrored` is a motor that turns backwards, by its own count, when the rover drives
    forward: its current and speed change their sign on the way in, its target velocity on the way out. `serial`
    (0x1018:04), where given, must match.
    """

    node_id: int
    kind: NodeKind
    wheel: int | None
    required: bool = True
    diagnostics: bool = False
    mirrored: bool = False
    serial: int | None = None


@dataclass(frozen=True, slots=True)
class Sync:
    """A SYNC seen on the bus (our own echo included): the instant that a snapshot is of."""

    time_ns: int


class Reading(NamedTuple):
    """One TPDO, decoded to SI units. `values` is empty where the node says that its measurement is not valid.

    A named tuple for the reason that `Frame` is one.
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


@dataclass(frozen=True, slots=True)
class Emergency:
    """An EMCY message (CiA 301, 7.2.7), in words.

    `code` 0x0000 means that the error of before is gone; `register` is object 0x1001; `vendor` are the five bytes that
    the manufacturer defines.
    """

    time_ns: int
    node_id: int
    code: int
    register: int
    vendor: bytes
    text: str

    @property
    def cleared(self) -> bool:
        """Whether this says that an error is gone, rather than that there is one."""
        return self.code == 0


Signal = Sync | Reading | NodeState | Emergency
