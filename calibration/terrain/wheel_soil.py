"""A rigid wheel on deformable soil: given load, slip and soil, the contact angle and the torque.

The stresses are the paper's (Eqs 1, 6, 7); the pressure–sinkage relation closes them, which the paper lacks:

    σ_m = (k_c/w + k_φ) (r (cos θ_m − cos θ_C))^n,   θ_m = θ_C/2

The shear displacement is taken where Eq. 1 is used, at θ_m, and not at the wheel's bottom as Eq. 10 does:

    j_m = r [(θ_C − θ_m) − (1 − i)(sin θ_C − sin θ_m)]

All functions take and return arrays of one shape (or what broadcasts to it); angles in radians, the rest SI. A soil is
one, or many as arrays that broadcast likewise.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.parameters import Soil, Wheel
    from regolithd.calibration.terrain.soils import Soils

    AnySoil = Soil | Soils

Array = NDArray[np.float64]

LARGEST_CONTACT_ANGLE_RAD = np.pi / 2
"""A wheel that is in to its axle. Past it the stress model means nothing."""


def shear_displacement(contact_angle_rad: Array, slip: Array, wheel: Wheel) -> Array:
    """Return the shear displacement at θ_m [m], j_m."""
    at = contact_angle_rad / 2
    return wheel.radius_m * (contact_angle_rad - at - (1 - slip) * (np.sin(contact_angle_rad) - np.sin(at)))


def peak_stresses(contact_angle_rad: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> tuple[Array, Array]:
    """Return normal and shear stress at θ_m [Pa] (pressure–sinkage; Eq. 1).

    A wheel that is dragged (j_m < 0) shears the soil the other way: Eq. 1 is continued as an odd function.
    """
    sinkage_m = wheel.radius_m * (np.cos(contact_angle_rad / 2) - np.cos(contact_angle_rad))
    stiffness = 1000 * (soil.k_c_kN / wheel.width_m + soil.k_phi_kN)
    normal = stiffness * sinkage_m**soil.sinkage_exponent
    displacement = shear_displacement(contact_angle_rad, slip, wheel)
    mobilised = -np.sign(displacement) * np.expm1(-np.abs(displacement) / soil.shear_modulus_m)
    strength = soil.cohesion_Pa + normal * np.tan(np.radians(soil.friction_angle_deg))
    return normal, strength * mobilised


def carried_load(contact_angle_rad: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the load that the contact carries [N] (Eq. 6)."""
    theta, half = contact_angle_rad, contact_angle_rad / 2
    normal, shear = peak_stresses(theta, slip, wheel, soil)
    # 1 + cos θ − 2 cos(θ/2) = −4 cos(θ/2) sin²(θ/4), which keeps its digits at small angles.
    bracket = (
        soil.cohesion_Pa * (theta - 2 * np.sin(half))
        + 8 * normal * np.cos(half) * np.sin(theta / 4) ** 2
        - 2 * shear * (np.sin(theta) - 2 * np.sin(half))
    )
    return wheel.radius_m * wheel.width_m / theta * bracket


def wheel_torque(contact_angle_rad: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the torque at the wheel [N·m] (Eq. 7)."""
    _, shear = peak_stresses(contact_angle_rad, slip, wheel, soil)
    return 0.5 * (shear + soil.cohesion_Pa / 2) * wheel.radius_m**2 * wheel.width_m * contact_angle_rad


def contact_angle(load_N: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the contact angle at which the soil carries the load [rad]: the inverse of Eq. 6.

    NaN where the load is not positive, or would bury the wheel to its axle.

    Notes
    -----
    Load grows nearly as a power of the angle, so a secant in logarithms converges in a few steps.
    """
    load = np.asarray(load_N, np.float64)
    slip = np.asarray(slip, np.float64)
    most = carried_load(
        np.full(np.broadcast_shapes(load.shape, slip.shape), LARGEST_CONTACT_ANGLE_RAD), slip, wheel, soil
    )
    with np.errstate(invalid="ignore"):
        known = (load > 0) & (load <= most) & np.isfinite(slip)
    # What has no answer is solved for a load that has one, and blanked afterwards.
    slip = np.where(np.isfinite(slip), slip, 0.0)
    wanted = np.log(np.where(known, load, 1.0))

    def excess(log_angle: Array) -> Array:
        return np.log(carried_load(np.exp(log_angle), slip, wheel, soil)) - wanted

    before = np.full(known.shape, np.log(0.2))
    now = np.full(known.shape, np.log(0.3))
    excess_before, excess_now = excess(before), excess(now)
    for _ in range(30):
        moved = now - before
        rise = excess_now - excess_before
        # A secant that stands still has arrived; where the slope is lost to rounding, so has it.
        step = np.divide(-excess_now * moved, rise, out=np.zeros_like(moved), where=np.abs(rise) > 1e-15)
        before, excess_before = now, excess_now
        now = np.minimum(now + np.clip(step, -1, 1), np.log(LARGEST_CONTACT_ANGLE_RAD))
        excess_now = excess(now)
        if not step.size or np.max(np.abs(step)) < 1e-13:
            break
    return np.where(known, np.exp(now), np.nan)
