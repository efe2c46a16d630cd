"""Eqs 1–10 of the paper [1]_, one function each: stresses under a rigid wheel, load, torque, sinkage, displacement.

Eqs 11–14, from motor current to load, are in `load_from_current`.

Angles are measured from the vertical. The wheel meets the soil at the contact angle θ_C, the stresses have their peaks
at θ_m = θ_C/2, and the wheel leaves the soil at θ = 0. Arguments and results are arrays of one shape, or of shapes
that broadcast; radians and SI units.

Assumptions of the paper: rigid wheel without grousers, linear stress distributions on either side of θ_m, quasi-static
motion. Eq. 10 gives the shear displacement at the lowest point of the wheel although Eq. 1 needs it at θ_m. It is kept
here as published; `calibration.terrain.wheel_soil` takes it at θ_m.

References
----------
.. [1] "Estimating terrain parameters for a rigid wheeled rover using neural networks", Journal of Terramechanics 50
   (2013) 165–174.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def slip(ground_speed_m_s: Array, wheel_speed_rad_s: Array, radius_m: float) -> Array:
    """Return the slip ratio: i = 1 − V/(r ω).

    Parameters
    ----------
    ground_speed_m_s
        Speed V of the hub over ground [m/s].
    wheel_speed_rad_s
        Angular speed ω of the wheel [rad/s].
    radius_m
        Wheel radius r [m].

    Returns
    -------
    Array
        Slip i [1]; NaN where the wheel stands still.
    """
    rim = radius_m * np.asarray(wheel_speed_rad_s, np.float64)
    return 1 - np.divide(ground_speed_m_s, rim, out=np.full(rim.shape, np.nan), where=rim != 0)


def peak_shear_stress(
    normal_Pa: Array, displacement_m: Array, cohesion_Pa: Array, tan_friction_angle: Array, shear_modulus_m: Array
) -> Array:
    """Return the peak shear stress (Eq. 1): τ_m = (c + σ_m tan φ)(1 − e^(−j/K)).

    Mohr–Coulomb strength, mobilised by the law of Janosi and Hanamoto (1961).

    Parameters
    ----------
    normal_Pa
        Normal stress σ_m [Pa].
    displacement_m
        Shear displacement j [m].
    cohesion_Pa
        Cohesion c [Pa].
    tan_friction_angle
        Tangent of the friction angle, tan φ [1].
    shear_modulus_m
        Shear deformation modulus K [m].

    Returns
    -------
    Array
        Peak shear stress τ_m [Pa].
    """
    return (cohesion_Pa + normal_Pa * tan_friction_angle) * -np.expm1(-displacement_m / shear_modulus_m)


def normal_stress(angle_rad: Array, contact_angle_rad: Array, peak_normal_Pa: Array) -> Array:
    """Return the normal stress at an angle (Eq. 4): linear on either side of θ_m, zero at θ = 0 and θ_C.

    Parameters
    ----------
    angle_rad
        Angle θ from the vertical [rad], 0 ≤ θ ≤ θ_C.
    contact_angle_rad
        Contact angle θ_C [rad], positive.
    peak_normal_Pa
        Peak normal stress σ_m [Pa].

    Returns
    -------
    Array
        Normal stress σ(θ) [Pa].
    """
    middle = contact_angle_rad / 2
    return peak_normal_Pa * np.clip(1 - np.abs(angle_rad - middle) / middle, 0, None)


def shear_stress(angle_rad: Array, contact_angle_rad: Array, peak_shear_Pa: Array, cohesion_Pa: Array) -> Array:
    """Return the shear stress at an angle (Eq. 5): c at θ = 0, τ_m at θ_m, zero at θ_C, linear between.

    Parameters
    ----------
    angle_rad
        Angle θ from the vertical [rad], 0 ≤ θ ≤ θ_C.
    contact_angle_rad
        Contact angle θ_C [rad], positive.
    peak_shear_Pa
        Peak shear stress τ_m [Pa].
    cohesion_Pa
        Cohesion c [Pa].

    Returns
    -------
    Array
        Shear stress τ(θ) [Pa].
    """
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
    """Return the load (Eq. 2): W = r w ∫ (σ cos θ + τ sin θ) dθ, by quadrature of Eqs 4 and 5.

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad], positive.
    peak_normal_Pa
        Peak normal stress σ_m [Pa].
    peak_shear_Pa
        Peak shear stress τ_m [Pa].
    cohesion_Pa
        Cohesion c [Pa].
    radius_m
        Wheel radius r [m].
    width_m
        Wheel width w [m].

    Returns
    -------
    Array
        Load W [N].
    """
    angle, weight = _quadrature(contact_angle_rad)
    normal = normal_stress(angle, contact_angle_rad, peak_normal_Pa)
    shear = shear_stress(angle, contact_angle_rad, peak_shear_Pa, cohesion_Pa)
    return radius_m * width_m * np.sum(weight * (normal * np.cos(angle) + shear * np.sin(angle)), axis=0)


def torque_by_integration(
    contact_angle_rad: Array, peak_shear_Pa: Array, cohesion_Pa: Array, radius_m: float, width_m: float
) -> Array:
    """Return the torque (Eq. 3): T = r² w ∫ τ dθ, by quadrature of Eq. 5.

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad], positive.
    peak_shear_Pa
        Peak shear stress τ_m [Pa].
    cohesion_Pa
        Cohesion c [Pa].
    radius_m
        Wheel radius r [m].
    width_m
        Wheel width w [m].

    Returns
    -------
    Array
        Torque T [N·m].
    """
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
    """Return the load in closed form (Eq. 6; the same as Eq. 14 of Step 14).

    W = r w / θ_C [c θ_C − 2 σ_m (1 + cos θ_C − 2 cos θ_m) − 2 τ_m (sin θ_C − 2 sin θ_m) − 2 c sin θ_m]

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad], positive.
    peak_normal_Pa
        Peak normal stress σ_m [Pa].
    peak_shear_Pa
        Peak shear stress τ_m [Pa].
    cohesion_Pa
        Cohesion c [Pa].
    radius_m
        Wheel radius r [m].
    width_m
        Wheel width w [m].

    Returns
    -------
    Array
        Load W [N].
    """
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
    """Return the torque in closed form (Eq. 7): T = ½ (τ_m + c/2) r² w θ_C.

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad], positive.
    peak_shear_Pa
        Peak shear stress τ_m [Pa].
    cohesion_Pa
        Cohesion c [Pa].
    radius_m
        Wheel radius r [m].
    width_m
        Wheel width w [m].

    Returns
    -------
    Array
        Torque T [N·m].
    """
    return 0.5 * (peak_shear_Pa + cohesion_Pa / 2) * radius_m**2 * width_m * contact_angle_rad


def slip_sinkage(static_sinkage_m: Array, slip: Array) -> Array:
    """Return the sinkage of a slipping wheel (Eq. 8, Lyasko): z_SS = z (1 + i)/(1 − i/2).

    Parameters
    ----------
    static_sinkage_m
        Static sinkage z [m].
    slip
        Slip i [1].

    Returns
    -------
    Array
        Sinkage z_SS [m].
    """
    return static_sinkage_m * (1 + slip) / (1 - 0.5 * slip)


def contact_angle(sinkage_m: Array, radius_m: float) -> Array:
    """Return the contact angle (Eq. 9): θ_C = arccos(1 − z/r).

    Parameters
    ----------
    sinkage_m
        Sinkage z [m], at most the radius.
    radius_m
        Wheel radius r [m].

    Returns
    -------
    Array
        Contact angle θ_C [rad].
    """
    return np.arccos(1 - sinkage_m / radius_m)


def shear_displacement(contact_angle_rad: Array, slip: Array, radius_m: float) -> Array:
    """Return the shear displacement at the lowest point of the wheel (Eq. 10): j = r [θ_C − (1 − i) sin θ_C].

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad], positive.
    slip
        Slip i [1].
    radius_m
        Wheel radius r [m].

    Returns
    -------
    Array
        Shear displacement j [m].
    """
    return radius_m * (contact_angle_rad + (slip - 1) * np.sin(contact_angle_rad))


def _quadrature(contact_angle_rad: Array) -> tuple[Array, Array]:
    """Return Gauss–Legendre nodes and weights on [0, θ_m] and [θ_m, θ_C], along a new first axis."""
    node, weight = np.polynomial.legendre.leggauss(8)
    shape = (-1,) + (1,) * np.ndim(contact_angle_rad)
    half = np.asarray(contact_angle_rad, np.float64) / 2
    behind = half * (node.reshape(shape) + 1) / 2
    return np.concatenate([behind, half + behind]), np.concatenate([half / 2 * weight.reshape(shape)] * 2)
