"""Least-squares estimator of cohesion and friction angle by Iagnemma et al. [1]_, with sinkage and K given.

The peak stresses follow from torque and load, and Eq. 1 relates them:

    τ_m = (c + σ_m tan φ)(1 − e^(−j/K)),   τ_m = S − c/2 (Eq. 12),   σ_m = a + b c (Eq. 6, linear in σ_m)

In the original both stresses are zero at the exit, and the equation is linear in both unknowns. With the paper's shear
stress, which is c at the exit, it is linear in c for a given tan φ: c is solved for, and tan φ is found by a grid
search in two stages. All measurements of a window enter one fit with equal weights (the same torque error for each).
The estimate is limited to plausible soils, which is to the method's advantage in comparisons.

References
----------
.. [1] K. Iagnemma, S. Kang, H. Shibly, S. Dubowsky, "Online terrain parameter estimation for wheeled mobile robots with
   application to planetary rovers", IEEE Transactions on Robotics 20 (2004) 921–927.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.paper import equations
from regolithd.calibration.paper.load_from_current import peak_shear_from_torque

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.calibration.parameters import Wheel

Array = NDArray[np.float64]

LARGEST_COHESION_PA = 12_000.0
SMALLEST_ANGLE_DEG, LARGEST_ANGLE_DEG = 5.0, 45.0


def least_squares(
    load_N: Array,
    torque_Nm: Array,
    contact_angle_rad: Array,
    displacement_m: Array,
    shear_modulus_m: Array,
    wheel: Wheel,
) -> tuple[Array, Array]:
    """Estimate cohesion and tan φ of N windows.

    Parameters
    ----------
    load_N
        Load W [N], shape (N, samples).
    torque_Nm
        Torque T [N·m], same shape.
    contact_angle_rad
        Contact angle θ_C [rad], same shape: the true one, as sinkage is given.
    displacement_m
        Shear displacement j [m], same shape.
    shear_modulus_m
        Shear deformation modulus K [m], shape (N, 1).
    wheel
        Wheel; radius r [m] and width w [m].

    Returns
    -------
    tuple of Array
        Cohesion c [Pa] and tan φ [1], each of shape (N,).
    """
    size = (wheel.radius_m, wheel.width_m)
    zero, one = np.zeros_like(load_N), np.ones_like(load_N)
    mobilised = -np.expm1(-displacement_m / shear_modulus_m)
    shear = peak_shear_from_torque(torque_Nm, contact_angle_rad, zero, *size)
    by_normal = equations.load(contact_angle_rad, one, zero, zero, *size)
    by_cohesion = equations.load(contact_angle_rad, zero, -one / 2, one, *size)
    normal = (load_N - equations.load(contact_angle_rad, zero, shear, zero, *size)) / by_normal
    normal_by_cohesion = -by_cohesion / by_normal

    def solve(tangent: Array) -> tuple[Array, Array]:
        """Return c and the squared error, shape (N, tangents), for tan φ of that shape."""
        t, m = tangent[..., None], mobilised[:, None]
        constant = shear[:, None] - m * normal[:, None] * t
        each = m + 0.5 + m * normal_by_cohesion[:, None] * t
        cohesion = np.clip((constant * each).sum(axis=-1) / (each**2).sum(axis=-1), 0, LARGEST_COHESION_PA)
        return cohesion, ((constant - each * cohesion[..., None]) ** 2).sum(axis=-1)

    coarse = np.radians(np.linspace(SMALLEST_ANGLE_DEG, LARGEST_ANGLE_DEG, 81))
    angle = _best(np.broadcast_to(coarse, (len(load_N), len(coarse))), solve)
    fine = np.clip(angle[:, None] + (coarse[1] - coarse[0]) * np.linspace(-1, 1, 81), coarse[0], coarse[-1])
    tangent = np.tan(_best(fine, solve))
    return solve(tangent[:, None])[0][:, 0], tangent


def _best(angles: Array, solve: Callable[[Array], tuple[Array, Array]]) -> Array:
    """Return the angle with the smallest squared error in each row."""
    _, error = solve(np.tan(angles))
    return angles[np.arange(len(angles)), error.argmin(axis=1)]
