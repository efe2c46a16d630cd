"""Drawbar pull of a rigid wheel: thrust of the shear stress less resistance of the normal stress, and its upper bound.

The horizontal components of the stresses of Eqs 4 and 5, integrated over the contact from 0 to θ_C:

    thrust H = r w ∫ τ cos θ dθ,   resistance R = r w ∫ σ sin θ dθ,   drawbar pull = H − R

The *drawbar margin* is (H_max − R)/W, where H_max is the thrust with the shear strength fully mobilised (τ_m = c + σ_m
tan φ). A rover on a slope of angle α needs a margin above sin α. It is an upper bound: the additional sinkage at the
slip that would mobilise the strength is not modelled.

Assumptions as in `wheel_soil`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.terrain.wheel_soil import Array, carried_load, peak_stresses, shear_strength

if TYPE_CHECKING:
    from regolithd.calibration.parameters import Wheel
    from regolithd.calibration.terrain.wheel_soil import AnySoil


def thrust(contact_angle_rad: Array, peak_shear_Pa: Array, cohesion_Pa: Array | float, wheel: Wheel) -> Array:
    """Return the horizontal force of the shear stress: H = r w ∫ τ cos θ dθ with τ of Eq. 5, in closed form.

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad].
    peak_shear_Pa
        Peak shear stress τ_m [Pa].
    cohesion_Pa
        Cohesion c [Pa]: the shear stress at the exit, θ = 0.
    wheel
        Wheel; radius r [m] and width w [m].

    Returns
    -------
    Array
        Thrust H [N], forward positive.
    """
    angle, middle = contact_angle_rad, contact_angle_rad / 2
    behind = cohesion_Pa * np.sin(middle) + (peak_shear_Pa - cohesion_Pa) * (
        np.sin(middle) + (np.cos(middle) - 1) / middle
    )
    front = peak_shear_Pa * ((np.cos(middle) - np.cos(angle)) / middle - np.sin(middle))
    return wheel.radius_m * wheel.width_m * (behind + front)


def resistance(contact_angle_rad: Array, peak_normal_Pa: Array, wheel: Wheel) -> Array:
    """Return the horizontal force of the normal stress: R = r w σ_m (2 sin θ_m − sin θ_C)/θ_m (Eq. 4, integrated).

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad].
    peak_normal_Pa
        Peak normal stress σ_m [Pa].
    wheel
        Wheel; radius r [m] and width w [m].

    Returns
    -------
    Array
        Compaction resistance R [N], backward positive.
    """
    middle = contact_angle_rad / 2
    bracket = (2 * np.sin(middle) - np.sin(contact_angle_rad)) / middle
    return wheel.radius_m * wheel.width_m * peak_normal_Pa * bracket


def drawbar_pull(contact_angle_rad: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the drawbar pull at a slip: thrust less resistance, H − R.

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad].
    slip
        Slip i [1].
    wheel, soil
        As in `wheel_soil.peak_stresses`.

    Returns
    -------
    Array
        Drawbar pull [N], forward positive.
    """
    normal, shear = peak_stresses(contact_angle_rad, slip, wheel, soil)
    forward = thrust(contact_angle_rad, shear, soil.cohesion_Pa, wheel)
    return forward - resistance(contact_angle_rad, normal, wheel)


def drawbar_margin(contact_angle_rad: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the drawbar margin: thrust at fully mobilised shear strength less resistance, over the load.

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad].
    slip
        Slip i [1]; it enters through the load that the contact carries.
    wheel, soil
        As in `wheel_soil.peak_stresses`.

    Returns
    -------
    Array
        Drawbar margin (H_max − R)/W [1].
    """
    normal, _ = peak_stresses(contact_angle_rad, slip, wheel, soil)
    largest = thrust(contact_angle_rad, shear_strength(normal, soil), soil.cohesion_Pa, wheel)
    backward = resistance(contact_angle_rad, normal, wheel)
    return (largest - backward) / carried_load(contact_angle_rad, slip, wheel, soil)
