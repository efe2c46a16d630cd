"""What the sensors of a rover read at one instant: the input of the virtual devices."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WHEELS = 6


def _wheels(value: float) -> Array:
    return np.full(WHEELS, value)


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """What every sensor on the rover reads at one instant; arrays of shape (6,), SI; wheel k is index k − 1.

    Signs: pitch positive nose up, roll positive right side down, yaw rate positive to the left.
    """

    motor_current_A: Array
    load_N: Array
    motor_temperature_degC: Array = field(default_factory=lambda: _wheels(20.0))
    bus_voltage_V: float = 24.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    yaw_rate_rad_s: float = 0.0
    ground_speed_m_s: float = 0.0
    hub_speed_m_s: Array = field(default_factory=lambda: _wheels(0.0))
