"""The seam between the nodes and the world they measure: physics is handed in, the nodes only report it.

    plant = MyPlant()
    measurement = plant.measure(time_s, motor_speeds_rad_s)

The nodes know neither wheel nor ground. Wheel k of the paper is index k − 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WHEELS = 6


def _wheels(value: float) -> Array:
    return np.full(WHEELS, value)


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """What every sensor on the rover would read at one instant; arrays of shape (6,), SI.

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


class Plant(Protocol):
    """The world: called once for each SYNC, and about fifty times a second where there is none."""

    def measure(self, time_s: float, motor_speed_rad_s: Array) -> Measurement:
        """Return what is measured at `time_s`, the motors turning at these speeds [rad/s], shape (6,).

        Time starts at 0, never falls, and is the same instant for all that is returned.
        """


class Bench:
    """Six drives on a bench, wheels up: a plant for those who need none.

    Each wheel has another load and current, so that a wheel that is taken for its neighbour shows.
    """

    def measure(self, time_s: float, motor_speed_rad_s: Array) -> Measurement:
        """Return constant loads, and currents that only have the sign of the speed."""
        del time_s
        wheel = np.arange(WHEELS, dtype=np.float64)
        return Measurement(
            motor_current_A=(0.040 + 0.001 * wheel) * np.sign(motor_speed_rad_s),
            load_N=50.0 + wheel,
            motor_temperature_degC=20.0 + 0.1 * wheel,
        )
