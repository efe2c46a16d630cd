"""Eqs 1–14 of the paper, one function each.

Angles are measured from the vertical: the wheel meets the soil at θ_C, carries the peak stresses at θ_m = θ_C/2 and
leaves it at θ_2 = 0. Arrays of one shape in, an array of that shape out; radians, metres, pascals, newtons.

Eq. 10 takes the shear displacement at the wheel's bottom although Eq. 1 uses it at θ_m. That is kept here, since this
folder is the paper; `calibration.terrain.wheel_soil` takes it at θ_m.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def slip(ground_speed_m_s: Array, wheel_speed_rad_s: Array, radius_m: float) -> Array:
    """Return the slip i = 1 − V/(r ω) [1]; NaN where the wheel stands still."""
    rim = radius_m * np.asarray(wheel_speed_rad_s, np.float64)
    return 1 - np.divide(ground_speed_m_s, rim, out=np.full(rim.shape, np.nan), where=rim != 0)


def peak_shear_stress(
    normal_Pa: Array, displacement_m: Array, cohesion_Pa: Array, tan_friction_angle: Array, shear_modulus_m: Array
) -> Array:
    """Return the peak shear stress τ_m [Pa] (Eq. 1: Mohr–Coulomb, mobilised as Janosi and Hanamoto say)."""
    return (cohesion_Pa + normal_Pa * tan_friction_angle) * -np.expm1(-displacement_m / shear_modulus_m)


def normal_stress(angle_rad: Array, contact_angle_rad: Array, peak_normal_Pa: Array) -> Array:
    """Return the normal stress at an angle [Pa] (Eq. 4): linear on either side of θ_m, zero at entry and exit."""
    middle = contact_angle_rad / 2
    return peak_normal_Pa * np.clip(1 - np.abs(angle_rad - middle) / middle, 0, None)


def shear_stress(angle_rad: Array, contact_angle_rad: Array, peak_shear_Pa: Array, cohesion_Pa: Array) -> Array:
    """Return the shear stress at an angle [Pa] (Eq. 5): zero at entry, τ_m at θ_m, c at the exit."""
    middle = contact_angle_rad / 2
    front = peak_shear_Pa * (contact_angle_rad - angle_rad) / middle
    behind = cohesion_Pa + (peak_shear_Pa - cohesion_Pa) * angle_rad / middle
    return np.where(angle_rad > middle, front, behind)


def load_by_integration(
    contact_angle_rad: Array,
    peak_normal_Pa: Array,
    peak_shear_Pa: Array,
    cohesion_Pa: Array,
    radius_m: float,
    width_m: float,
) -> Array:
    """Return the load that the stresses carry [N] (Eq. 2, by quadrature of Eqs 4 and 5)."""
    angle, weight = _quadrature(contact_angle_rad)
    normal = normal_stress(angle, contact_angle_rad, peak_normal_Pa)
    shear = shear_stress(angle, contact_angle_rad, peak_shear_Pa, cohesion_Pa)
    return radius_m * width_m * np.sum(weight * (normal * np.cos(angle) + shear * np.sin(angle)), axis=0)


def torque_by_integration(
    contact_angle_rad: Array, peak_shear_Pa: Array, cohesion_Pa: Array, radius_m: float, width_m: float
) -> Array:
    """Return the torque of the stresses [N·m] (Eq. 3, by quadrature of Eq. 5)."""
    angle, weight = _quadrature(contact_angle_rad)
    shear = shear_stress(angle, contact_angle_rad, peak_shear_Pa, cohesion_Pa)
    return radius_m**2 * width_m * np.sum(weight * shear, axis=0)


def load(
    contact_angle_rad: Array,
    peak_normal_Pa: Array,
    peak_shear_Pa: Array,
    cohesion_Pa: Array,
    radius_m: float,
    width_m: float,
) -> Array:
    """Return the load that the stresses carry [N] (Eq. 6; the same as Eq. 14 of Step 14)."""
    theta, half = contact_angle_rad, contact_angle_rad / 2
    bracket = (
        cohesion_Pa * theta
        - 2 * peak_normal_Pa * (1 + np.cos(theta) - 2 * np.cos(half))
        - 2 * peak_shear_Pa * (np.sin(theta) - 2 * np.sin(half))
        - 2 * cohesion_Pa * np.sin(half)
    )
    return radius_m * width_m / theta * bracket


def torque(
    contact_angle_rad: Array, peak_shear_Pa: Array, cohesion_Pa: Array, radius_m: float, width_m: float
) -> Array:
    """Return the torque at the wheel [N·m] (Eq. 7)."""
    return 0.5 * (peak_shear_Pa + cohesion_Pa / 2) * radius_m**2 * width_m * contact_angle_rad


def slip_sinkage(static_sinkage_m: Array, slip: Array) -> Array:
    """Return the sinkage of a slipping wheel z_SS [m] (Eq. 8, Lyasko)."""
    return static_sinkage_m * (1 + slip) / (1 - 0.5 * slip)


def contact_angle(sinkage_m: Array, radius_m: float) -> Array:
    """Return the contact angle θ_C [rad] (Eq. 9)."""
    return np.arccos(1 - sinkage_m / radius_m)


def shear_displacement(contact_angle_rad: Array, slip: Array, radius_m: float) -> Array:
    """Return the shear displacement at the wheel's bottom j [m] (Eq. 10)."""
    return radius_m * (contact_angle_rad + (slip - 1) * np.sin(contact_angle_rad))


def torque_from_current(motor_current_A: Array, gain_Nm_per_A: float) -> Array:
    """Return the torque at the wheel [N·m] (Eq. 11, its constants multiplied into one gain)."""
    return gain_Nm_per_A * np.asarray(motor_current_A, np.float64)


def peak_shear_from_torque(
    torque_Nm: Array, contact_angle_rad: Array, cohesion_Pa: Array, radius_m: float, width_m: float
) -> Array:
    """Return the peak shear stress that a torque needs τ_m [Pa] (Eq. 12: Eq. 7 inverted)."""
    return 2 * torque_Nm / (width_m * radius_m**2 * contact_angle_rad) - cohesion_Pa / 2


def peak_normal_from_shear(
    peak_shear_Pa: Array, displacement_m: Array, cohesion_Pa: Array, tan_friction_angle: Array, shear_modulus_m: Array
) -> Array:
    """Return the peak normal stress that a shear stress needs σ_m [Pa] (Eq. 13: Eq. 1 inverted)."""
    mobilised = -np.expm1(-displacement_m / shear_modulus_m)
    return (peak_shear_Pa / mobilised - cohesion_Pa) / tan_friction_angle


def load_from_current(
    motor_current_A: Array,
    slip: Array,
    static_sinkage_m: Array,
    cohesion_Pa: Array,
    tan_friction_angle: Array,
    shear_modulus_m: Array,
    *,
    radius_m: float,
    width_m: float,
    gain_Nm_per_A: float,
) -> Array:
    """Return the load that goes with a current [N] (Eq. 14: Eqs 8–13 and then Eq. 6)."""
    theta = contact_angle(slip_sinkage(static_sinkage_m, slip), radius_m)
    displacement = shear_displacement(theta, slip, radius_m)
    wheel_torque = torque_from_current(motor_current_A, gain_Nm_per_A)
    shear = peak_shear_from_torque(wheel_torque, theta, cohesion_Pa, radius_m, width_m)
    normal = peak_normal_from_shear(shear, displacement, cohesion_Pa, tan_friction_angle, shear_modulus_m)
    return load(theta, normal, shear, cohesion_Pa, radius_m, width_m)


def _quadrature(contact_angle_rad: Array) -> tuple[Array, Array]:
    """Return nodes and weights over [0, θ_m] and [θ_m, θ_C], where the stresses are smooth; new first axis."""
    node, weight = np.polynomial.legendre.leggauss(8)
    shape = (-1,) + (1,) * np.ndim(contact_angle_rad)
    half = np.asarray(contact_angle_rad, np.float64) / 2
    behind = half * (node.reshape(shape) + 1) / 2
    return np.concatenate([behind, half + behind]), np.concatenate([half / 2 * weight.reshape(shape)] * 2)
