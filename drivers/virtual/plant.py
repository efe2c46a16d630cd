"""The interface between the virtual nodes and the simulated rover that they measure.

    plant = MyPlant()
    measurement = plant.measure(time_s, motor_speeds_rad_s)

The physics is passed in; the nodes only report it. Wheel k of the paper is index k − 1.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from regolithd.drivers.devices.virtual.measurement import WHEELS, Array, Measurement

__all__ = ["WHEELS", "Array", "Bench", "Measurement", "Plant"]


class Plant(Protocol):
    """The simulated rover: called once for each SYNC, and about fifty times a second where there is none."""

    def measure(self, time_s: float, motor_speed_rad_s: Array) -> Measurement:
        """Return what is measured at `time_s`, the motors turning at these speeds [rad/s], shape (6,).

        Time starts at 0, never falls, and is the same instant for all that is returned.
        """


class Bench:
    """Six drives on a bench, wheels off the ground: a plant without physics.

    Each wheel has another load and current, so that values assigned to the wrong wheel are noticed.
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
