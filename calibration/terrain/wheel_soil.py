"""A rigid, smooth wheel on deformable soil: stresses, load, torque and contact angle from slip and soil parameters.

The contact runs from θ = 0 (below the axle) to the contact angle θ_C. Normal and shear stress have their peaks σ_m and
τ_m at θ_m = θ_C/2 and are linear on either side of it (Eqs 4 and 5). Of two relations the paper [1]_ has none, or
another:

| relation | here | in the paper |
|---|---|---|
| σ_m | Bernstein–Wong pressure–sinkage relation at θ_m [2]_ | none: sinkage is given |
| j in Eq. 1 | shear displacement at θ_m, where Eq. 1 is evaluated | at the lowest point, θ = 0 (Eq. 10) |

Assumptions: quasi-static motion; no grousers; no bulldozing; the soil leaves the wheel at θ = 0.

Every function takes and returns arrays of one shape, or of shapes that broadcast; angles in radians, the rest in SI
units. A soil is one `Soil`, or `Soils` whose arrays broadcast likewise.

References
----------
.. [1] "Estimating terrain parameters for a rigid wheeled rover using neural networks", Journal of Terramechanics 50
   (2013) 165–174.
.. [2] J. Y. Wong, "Theory of Ground Vehicles", 4th ed., Wiley, 2008, Sec. 2.4.
.. [3] Z. Janosi, B. Hanamoto, "The analytical determination of drawbar pull as a function of slip for tracked vehicles
   in deformable soils", Proc. 1st Int. Conf. on the Mechanics of Soil–Vehicle Systems, Turin, 1961.
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
"""Contact angle of a wheel that is sunk to its axle; the stress model is not defined beyond it."""

_MAX_ITERATIONS = 30
"""Secant steps in `contact_angle`; loads that a soil can carry need fewer than ten."""
_TOLERANCE = 1e-8
"""Largest change of ln θ_C in the last secant step. What is left is about its product with the step before, of about
1e-5 and less: 4e-15 at most in 80 000 angles of four soils."""


def sinkage_at_peak_stress(contact_angle_rad: Array, wheel: Wheel) -> Array:
    """Return how deep the rim is below the undisturbed surface at θ_m: r (cos θ_m − cos θ_C).

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad].
    wheel
        Wheel; its radius r [m] is used.

    Returns
    -------
    Array
        Sinkage of the rim at θ_m [m].
    """
    return _sinkage(np.sin(contact_angle_rad / 4), wheel)


def _sinkage(sine: Array, wheel: Wheel) -> Array:
    """Return the same from s = sin(θ_C/4): 2 r s² (3 − 4 s²), without a difference of cosines."""
    return 2 * wheel.radius_m * sine**2 * (3 - 4 * sine**2)


def peak_normal_stress(contact_angle_rad: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the peak normal stress by the Bernstein–Wong relation: σ_m = (k_c/w + k_φ) z_m^n [2]_.

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad].
    wheel
        Wheel; radius r [m] and width w [m].
    soil
        Soil; k_c [kN/m^(n+1)], k_φ [kN/m^(n+2)] and n [1].

    Returns
    -------
    Array
        Peak normal stress σ_m [Pa].
    """
    return _normal_stress(np.sin(contact_angle_rad / 4), wheel, soil)


def _normal_stress(sine: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the same from sin(θ_C/4)."""
    stiffness = 1000 * (soil.k_c_kN / wheel.width_m + soil.k_phi_kN)
    return stiffness * _sinkage(sine, wheel) ** soil.sinkage_exponent


def shear_displacement(contact_angle_rad: Array, slip: Array, wheel: Wheel) -> Array:
    """Return the shear displacement at θ_m: j_m = r [(θ_C − θ_m) − (1 − i)(sin θ_C − sin θ_m)].

    Eq. 10 with its integral ended at θ_m instead of at θ = 0.

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad].
    slip
        Slip i [1].
    wheel
        Wheel; its radius r [m] is used.

    Returns
    -------
    Array
        Shear displacement j_m [m]; negative for a wheel that is dragged.
    """
    return _displacement(contact_angle_rad, np.sin(contact_angle_rad / 4), slip, wheel)


def _displacement(contact_angle_rad: Array, sine: Array, slip: Array, wheel: Wheel) -> Array:
    """Return the same from θ_C and s = sin(θ_C/4): sin θ_C − sin θ_m = sin θ_m (1 − 4 s²)."""
    risen = _sine_at_peak(sine) * (1 - 4 * sine**2)
    return wheel.radius_m * (contact_angle_rad / 2 - (1 - slip) * risen)


def _sine_at_peak(sine: Array) -> Array:
    """Return sin θ_m from s = sin(θ_C/4): 2 s √(1 − s²)."""
    return 2 * sine * np.sqrt(1 - sine**2)


def mobilised_share(displacement_m: Array, soil: AnySoil) -> Array:
    """Return the mobilised share of the shear strength: sign(j) (1 − e^(−|j|/K)) (Janosi and Hanamoto [3]_).

    Parameters
    ----------
    displacement_m
        Shear displacement j [m]. For j < 0 (a dragged wheel) the law is continued as an odd function.
    soil
        Soil; its shear deformation modulus K [m] is used.

    Returns
    -------
    Array
        Share of the strength [1], between −1 and 1.
    """
    return -np.sign(displacement_m) * np.expm1(-np.abs(displacement_m) / soil.shear_modulus_m)


def shear_strength(normal_Pa: Array, soil: AnySoil) -> Array:
    """Return the Mohr–Coulomb shear strength: c + σ tan φ.

    Parameters
    ----------
    normal_Pa
        Normal stress σ [Pa].
    soil
        Soil; cohesion c [Pa] and friction angle φ [°].

    Returns
    -------
    Array
        Shear strength [Pa].
    """
    return soil.cohesion_Pa + normal_Pa * np.tan(np.radians(soil.friction_angle_deg))


def peak_stresses(contact_angle_rad: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> tuple[Array, Array]:
    """Return the peak normal and shear stress; the shear stress is Eq. 1 at θ_m: τ_m = (c + σ_m tan φ)(1 − e^(−j_m/K)).

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad].
    slip
        Slip i [1].
    wheel, soil
        As in `peak_normal_stress` and `shear_displacement`.

    Returns
    -------
    tuple of Array
        σ_m [Pa] and τ_m [Pa].
    """
    return _stresses(contact_angle_rad, np.sin(contact_angle_rad / 4), slip, wheel, soil)


def _stresses(contact_angle_rad: Array, sine: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> tuple[Array, Array]:
    """Return the same from θ_C and sin(θ_C/4): sines take most of the time of a comparison's predictions."""
    normal = _normal_stress(sine, wheel, soil)
    mobilised = mobilised_share(_displacement(contact_angle_rad, sine, slip, wheel), soil)
    return normal, shear_strength(normal, soil) * mobilised


def carried_load(contact_angle_rad: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the load that the contact carries (Eq. 6).

    W = r w / θ_C [c θ_C − 2 σ_m (1 + cos θ_C − 2 cos θ_m) − 2 τ_m (sin θ_C − 2 sin θ_m) − 2 c sin θ_m]

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad], positive.
    slip
        Slip i [1].
    wheel, soil
        As in `peak_stresses`.

    Returns
    -------
    Array
        Load W normal to the ground [N].
    """
    theta, sine = contact_angle_rad, np.sin(contact_angle_rad / 4)
    normal, shear = _stresses(theta, sine, slip, wheel, soil)
    square, at_peak = sine**2, _sine_at_peak(sine)
    # With s = sin(θ/4): cos θ/2 = 1 − 2 s², 1 + cos θ − 2 cos(θ/2) = −4 s² cos θ/2, sin θ − 2 sin θ/2 = −4 s² sin θ/2.
    # No digits cancel at small angles, and one sine serves all of them.
    bracket = soil.cohesion_Pa * (theta - 2 * at_peak) + 8 * square * (normal * (1 - 2 * square) + shear * at_peak)
    return wheel.radius_m * wheel.width_m / theta * bracket


def wheel_torque(contact_angle_rad: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the torque that the soil's shear stress opposes to the wheel (Eq. 7): T = ½ (τ_m + c/2) r² w θ_C.

    Parameters
    ----------
    contact_angle_rad
        Contact angle θ_C [rad].
    slip
        Slip i [1].
    wheel, soil
        As in `peak_stresses`.

    Returns
    -------
    Array
        Torque T at the wheel [N·m].
    """
    _, shear = peak_stresses(contact_angle_rad, slip, wheel, soil)
    return 0.5 * (shear + soil.cohesion_Pa / 2) * wheel.radius_m**2 * wheel.width_m * contact_angle_rad


def contact_angle(load_N: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return the contact angle at which the soil carries a load: Eq. 6 (`carried_load`) solved for θ_C.

    Parameters
    ----------
    load_N
        Load W normal to the ground [N].
    slip
        Slip i [1].
    wheel, soil
        As in `peak_stresses`.

    Returns
    -------
    Array
        Contact angle θ_C [rad]; NaN where the load is not positive, is more than the soil carries at
        `LARGEST_CONTACT_ANGLE_RAD`, or where load or slip is NaN.

    Notes
    -----
    Secant method on ln W against ln θ_C: the load is nearly a power of the angle, so it converges in a few steps.
    """
    load = np.asarray(load_N, np.float64)
    slip = np.asarray(slip, np.float64)
    most = carried_load(np.asarray(LARGEST_CONTACT_ANGLE_RAD), slip, wheel, soil)
    with np.errstate(invalid="ignore"):
        solvable = (load > 0) & (load <= most) & np.isfinite(slip)
    # Elements without a solution are solved for 1 N at no slip, and set to NaN afterwards.
    slip = np.where(np.isfinite(slip), slip, 0.0)
    log_load = np.log(np.where(solvable, load, 1.0))
    log_angle = _solve_log_angle(log_load, slip, wheel, soil)
    return np.where(solvable, np.exp(log_angle), np.nan)


def _solve_log_angle(log_load: Array, slip: Array, wheel: Wheel, soil: AnySoil) -> Array:
    """Return ln θ_C for ln W, by the secant method from θ_C = 0.2 and 0.3 rad."""

    def excess(log_angle: Array) -> Array:
        return np.log(carried_load(np.exp(log_angle), slip, wheel, soil)) - log_load

    # The first two angles are the same everywhere: their sines are computed once.
    before, now = (np.full([1] * log_load.ndim, np.log(angle)) for angle in (0.2, 0.3))
    excess_before, excess_now = excess(before), excess(now)
    for _ in range(_MAX_ITERATIONS):
        moved = now - before
        rise = excess_now - excess_before
        # An element has converged where its last step was zero, or too small for a slope: it stays.
        step = np.divide(-excess_now * moved, rise, out=np.zeros_like(rise), where=np.abs(rise) > 1e-15)
        before, excess_before = now, excess_now
        now = np.minimum(now + np.clip(step, -1, 1), np.log(LARGEST_CONTACT_ANGLE_RAD))
        if not step.size or np.max(np.abs(step)) < _TOLERANCE:
            break
        excess_now = excess(now)
    return now
