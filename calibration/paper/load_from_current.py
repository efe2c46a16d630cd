"""Eqs 11–14 of the paper, one function each: the load that a motor current corresponds to, for a given soil.

Torque from current (Eq. 11), peak shear stress from torque (Eq. 12), peak normal stress from shear stress (Eq. 13),
load from both (Eq. 14). Symbols and assumptions as in `equations`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.paper import equations

Array = NDArray[np.float64]


def torque_from_current(motor_current_A: Array, gain_Nm_per_A: float) -> Array:
    """Return the torque at the wheel (Eq. 11): T = κ ζ_PG ζ_HD η_PG η_HD I.

    Parameters
    ----------
    motor_current_A
        Motor current I [A].
    gain_Nm_per_A
        Gain κ ζ_PG ζ_HD η_PG η_HD [N·m/A].

    Returns
    -------
    Array
        Torque T [N·m].
    """
    return gain_Nm_per_A * np.asarray(motor_current_A, np.float64)


def peak_shear_from_torque(
    torque_Nm: Array, contact_angle_rad: Array, cohesion_Pa: Array, radius_m: float, width_m: float
) -> Array:
    """Return the peak shear stress of a torque (Eq. 12: Eq. 7 inverted): τ_m = 2 T/(w r² θ_C) − c/2.

    Parameters
    ----------
    torque_Nm
        Torque T at the wheel [N·m].
    contact_angle_rad
        Contact angle θ_C [rad], positive.
    cohesion_Pa
        Cohesion c [Pa].
    radius_m
        Wheel radius r [m].
    width_m
        Wheel width w [m].

    Returns
    -------
    Array
        Peak shear stress τ_m [Pa].
    """
    return 2 * torque_Nm / (width_m * radius_m**2 * contact_angle_rad) - cohesion_Pa / 2


def peak_normal_from_shear(
    peak_shear_Pa: Array, displacement_m: Array, cohesion_Pa: Array, tan_friction_angle: Array, shear_modulus_m: Array
) -> Array:
    """Return the peak normal stress of a peak shear stress (Eq. 13: Eq. 1 inverted).

    σ_m = [τ_m/(1 − e^(−j/K)) − c]/tan φ

    Parameters
    ----------
    peak_shear_Pa
        Peak shear stress τ_m [Pa].
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
        Peak normal stress σ_m [Pa].
    """
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
    """Return the load that a motor current corresponds to (Eq. 14: Eqs 8–13, then Eq. 6).

    Parameters
    ----------
    motor_current_A
        Motor current I [A].
    slip
        Slip i [1].
    static_sinkage_m
        Static sinkage z [m].
    cohesion_Pa
        Cohesion c [Pa].
    tan_friction_angle
        Tangent of the friction angle, tan φ [1].
    shear_modulus_m
        Shear deformation modulus K [m].
    radius_m
        Wheel radius r [m].
    width_m
        Wheel width w [m].
    gain_Nm_per_A
        Gain κ ζ_PG ζ_HD η_PG η_HD [N·m/A].

    Returns
    -------
    Array
        Load W [N].
    """
    theta = equations.contact_angle(equations.slip_sinkage(static_sinkage_m, slip), radius_m)
    displacement = equations.shear_displacement(theta, slip, radius_m)
    wheel_torque = torque_from_current(motor_current_A, gain_Nm_per_A)
    shear = peak_shear_from_torque(wheel_torque, theta, cohesion_Pa, radius_m, width_m)
    normal = peak_normal_from_shear(shear, displacement, cohesion_Pa, tan_friction_angle, shear_modulus_m)
    return equations.load(theta, normal, shear, cohesion_Pa, radius_m, width_m)
