"""Thrust against resistance under a wheel, and the margin between them.

The stresses of Eqs 4 and 5 have, besides load and torque, a horizontal part: shear pushes the wheel forward, normal
stress holds it back.

    thrust = r w ∫ τ cos θ dθ,   resistance = r w ∫ σ sin θ dθ

The *drawbar margin* is what the soil under the wheel could still give if the wheel slipped until its shear strength is
all mobilised, less the resistance, over the load. It is what may be spent on slope: a rover on a slope of angle α needs
a margin above sin α. Nothing of the digging that much slip would bring is in it, so it is an upper bound.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.terrain.wheel_soil import Array, carried_load, peak_stresses

if TYPE_CHECKING:
    from regolithd.calibration.parameters import Wheel
    from regolithd.calibration.terrain.wheel_soil import AnySoil


def thrust(contact_angle_rad: Array, peak_shear_Pa: Array, cohesion_Pa: Array | float, wheel: Wheel) -> Array:
    """Return the horizontal force of the shear stresses [N], forward positive (Eq. 5, integrated)."""
    angle, middle = contact_angle_rad, contact_angle_rad / 2
    behind = cohesion_Pa * np.sin(middle) + (peak_shear_Pa - cohesion_Pa) * (
        np.sin(middle) + (np.cos(middle) - 1) / middle
    )
    front = peak_shear_Pa * ((np.cos(middle) - np.cos(angle)) / middle - np.sin(middle))
    return wheel.radius_m * wheel.width_m * (behind + front)


def resistance(contact_angle_rad: Array, peak_normal_Pa: Array, wheel: Wheel) -> Array:
    """Return the horizontal force of the normal stresses [N], backward positive (Eq. 4, integrated)."""
    middle = contact_angle_rad / 2
    bracket = (2 * np.sin(middle) - np.sin(contact_angle_rad)) / middle
    return wheel.radius_m * wheel.width_m * peak_normal_Pa * bracket


def drawbar_pull(contact_angle_rad: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return thrust less resistance at this slip [N]."""
    normal, shear = peak_stresses(contact_angle_rad, slip, wheel, soil)
    pushed = thrust(contact_angle_rad, shear, soil.cohesion_Pa, wheel)
    return pushed - resistance(contact_angle_rad, normal, wheel)


def drawbar_margin(contact_angle_rad: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the drawbar margin [1]: all the thrust that the soil has less the resistance, over the load."""
    normal, _ = peak_stresses(contact_angle_rad, slip, wheel, soil)
    strength = soil.cohesion_Pa + normal * np.tan(np.radians(soil.friction_angle_deg))
    available = thrust(contact_angle_rad, strength, soil.cohesion_Pa, wheel)
    held = resistance(contact_angle_rad, normal, wheel)
    return (available - held) / carried_load(contact_angle_rad, slip, wheel, soil)
