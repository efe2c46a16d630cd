"""Loads of six wheels from mass, geometry, pitch and roll.

A six-wheel rover is statically indeterminate. Assumptions:

- the loads are a plane over the wheels' positions that balances weight and moments: a rocker-bogie equalises the loads
  as far as its pivots allow;
- three axles, evenly spaced over the wheelbase, wheels at ± half the track;
- the centre of gravity lies above the middle of wheelbase and track;
- quasi-static: no acceleration.

    W_k = (m g cos α / 6) (1 + x_k h_x / ⟨x²⟩ + y_k h_y / ⟨y²⟩),   h_x = −h tan(pitch),   h_y = −h tan(roll)

with x forward, y to the left, h the height of the centre of gravity above ground, and cos α = cos(pitch) cos(roll).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import GRAVITY_M_S2

if TYPE_CHECKING:
    from regolithd.calibration.parameters import Rover

Array = NDArray[np.float64]

_FORWARD = np.array([1.0, 1.0, 0.0, 0.0, -1.0, -1.0])
_LEFT = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def wheel_loads(pitch_rad: Array, roll_rad: Array, rover: Rover, gravity_height_m: float = 0.25) -> Array:
    """Return the load of each wheel normal to the ground.

    Parameters
    ----------
    pitch_rad
        Pitch [rad], nose up positive, any shape.
    roll_rad
        Roll [rad], right side down positive, same shape.
    rover
        Rover; mass [kg], wheelbase [m] and track [m].
    gravity_height_m
        Height h of the centre of gravity above ground [m].

    Returns
    -------
    Array
        Loads W_k [N], shape (…, 6); 0 where the formula gives a negative load.
    """
    pitch, roll = (np.asarray(angle, np.float64)[..., None] for angle in (pitch_rad, roll_rad))
    x, y = _FORWARD * rover.wheelbase_m / 2, _LEFT * rover.track_m / 2
    level = rover.mass_kg * GRAVITY_M_S2 * np.cos(pitch) * np.cos(roll) / len(x)
    shift_x, shift_y = -gravity_height_m * np.tan(pitch), -gravity_height_m * np.tan(roll)
    return np.clip(level * (1 + x * shift_x / np.mean(x**2) + y * shift_y / np.mean(y**2)), 0, None)
