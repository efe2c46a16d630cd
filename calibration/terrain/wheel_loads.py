"""How the body's weight comes down on six wheels, from mass, geometry, pitch and roll.

A six-wheel rover is statically indeterminate; a rocker-bogie makes the loads of a side as equal as its pivots allow.
Here they are the plane that balances weight and moments: equal on level ground, and shifted downhill by the height of
the centre of gravity. Wheels stand at ±half the track, and at front, middle and rear along the wheelbase.

    W_k = (m g cos α / 6) (1 + x_k h_x / ⟨x²⟩ + y_k h_y / ⟨y²⟩),   h_x = −h tan(pitch),   h_y = −h tan(roll)

with x forward, y to the left, and h the height of the centre of gravity over the ground.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.parameters import Rover

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.80665
_FORWARD = np.array([1.0, 1.0, 0.0, 0.0, -1.0, -1.0])
_LEFT = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def wheel_loads(pitch_rad: Array, roll_rad: Array, rover: Rover, gravity_height_m: float = 0.25) -> Array:
    """Return the load normal to the ground on each wheel [N], shape (…, 6).

    Pitch is positive nose up and roll positive right side down. A wheel that would be pulled down carries nothing.
    """
    pitch, roll = (np.asarray(angle, np.float64)[..., None] for angle in (pitch_rad, roll_rad))
    x, y = _FORWARD * rover.wheelbase_m / 2, _LEFT * rover.track_m / 2
    level = rover.mass_kg * GRAVITY_M_S2 * np.cos(pitch) * np.cos(roll) / len(x)
    ahead, aside = -gravity_height_m * np.tan(pitch), -gravity_height_m * np.tan(roll)
    return np.clip(level * (1 + x * ahead / np.mean(x**2) + y * aside / np.mean(y**2)), 0, None)
