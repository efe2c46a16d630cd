"""The data of one SYNC: a `Snapshot` of the measurements, and the `Estimate` that the pipeline computes from it.

All arrays are float64 (or bool for masks) of shape (6,), read-only, SI; wheel k of the paper is index k − 1. NaN means
"not measured": a value that did not arrive is never repeated and never invented.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.drivers.devices.ground_speed import GROUND_SPEED
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import MOTOR_CURRENT, MOTOR_SPEED
from regolithd.drivers.devices.registry import QUANTITIES

if TYPE_CHECKING:
    from regolithd.calibration.posterior.change_detection import Alarm
    from regolithd.calibration.posterior.estimator import FallProbability, Posterior
    from regolithd.drivers.devices.device import Quantity

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WHEELS = 6
ROW = {quantity: row for row, quantity in enumerate(QUANTITIES)}
WHEEL_QUANTITIES = tuple(quantity for quantity in QUANTITIES if quantity.per_wheel)
BODY_QUANTITIES = tuple(quantity for quantity in QUANTITIES if not quantity.per_wheel)
NEEDED = (MOTOR_CURRENT, MOTOR_SPEED, LOAD)
"""The quantities that an estimate of a wheel needs."""

_NEEDED_ROWS = [ROW[quantity] for quantity in NEEDED]


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """The measurements of one SYNC.

    Attributes
    ----------
    sequence
        Counts the SYNCs since the daemon's start (or the log's), from 0.
    time_ns
        The SYNC's kernel time, CLOCK_REALTIME.
    values
        Shape (quantities, 6): one row for each of `devices.registry.QUANTITIES`. A quantity of the whole body has the
        same value in all six columns.
    """

    sequence: int
    time_ns: int
    values: Array

    def __getitem__(self, quantity: Quantity) -> Array:
        """Return one quantity, shape (6,)."""
        return self.values[ROW[quantity]]

    @property
    def motor_current_A(self) -> Array:
        """Motor current, signed [A]."""
        return self[MOTOR_CURRENT]

    @property
    def motor_speed_rad_s(self) -> Array:
        """Motor speed before the gears, signed [rad/s]."""
        return self[MOTOR_SPEED]

    @property
    def load_N(self) -> Array:
        """Load on the wheel [N]."""
        return self[LOAD]

    @property
    def ground_speed_m_s(self) -> Array:
        """Speed of the hub over ground [m/s]."""
        return self[GROUND_SPEED]

    @property
    def valid(self) -> Mask:
        """Where current, speed and load all arrived in this SYNC's window."""
        needed: Mask = np.isfinite(self.values[_NEEDED_ROWS])
        return np.logical_and.reduce(needed, axis=0)


@dataclass(frozen=True, slots=True)
class AcquisitionCounters:
    """Counts since the start: every reading is accepted, late, duplicate, unexpected or doubtful."""

    snapshots: int = 0
    accepted: int = 0  # readings that went into a snapshot
    late: int = 0  # readings before the first SYNC, after their window, or ambiguous (`acquire`)
    duplicate: int = 0  # a second reading of the same PDO in one window; the first is kept
    unexpected: int = 0  # readings from nodes that the configuration does not know
    missing: int = 0  # PDOs that were expected in a window and did not come, not in time, or were doubtful
    doubtful: int = 0  # readings while two nodes have one node-ID, or a second SYNC producer is on the bus


class SlipSource(StrEnum):
    """The source of a slip."""

    MEASURED = "ground-speed"
    CONFIGURED = "configured"
    NONE = "none"  # the wheel stands still: its slip is undefined


@dataclass(frozen=True, slots=True)
class SoilChange:
    """A soil-change alarm, and the probability that each quantity fell; None where too little was measured before."""

    alarm: Alarm
    fall: FallProbability | None


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """The values that the pipeline computed from one snapshot, to be recorded and published.

    Attributes
    ----------
    snapshot
        The measurements.
    wheel_torque_Nm
        Torque at the wheel by Eq. 11, unsmoothed; positive where it drives forward.
    smoothed_torque_Nm, smoothed_load_N
        Torque and load after the filter that removes momentary drops.
    slip
        i = 1 − V/(r ω); NaN while the wheel stands still. `slip_source` is the source for each wheel.
    cohesion_Pa, friction_angle_rad
        The terrain network's estimate; NaN where `valid` is false.
    valid
        Where an estimate could be made.
    input_names
        Names of the terrain network's inputs, from its model card.
    outside
        Shape (inputs, 6): where an input lies outside the range that the network was trained on.
    model_version
        The terrain network's version.
    posterior
        Credible intervals of the soil, from the last seconds of all wheels; None unless a half second has just ended.
    soil_change
        The alarm that the soil has changed; None unless it has just been raised.
    """

    snapshot: Snapshot
    wheel_torque_Nm: Array
    smoothed_torque_Nm: Array
    smoothed_load_N: Array
    slip: Array
    slip_source: tuple[SlipSource, ...]
    cohesion_Pa: Array
    friction_angle_rad: Array
    valid: Mask
    input_names: tuple[str, ...]
    outside: Mask
    model_version: str
    posterior: Posterior | None = None
    soil_change: SoilChange | None = None

    @property
    def outside_inputs(self) -> list[tuple[str, ...]]:
        """The names of the inputs that lie outside the training range, for each wheel."""
        if not np.logical_or.reduce(self.outside, axis=None):  # several times as fast as `any`
            return [()] * WHEELS
        return [
            tuple(name for name, out in zip(self.input_names, column, strict=True) if out) for column in self.outside.T
        ]
