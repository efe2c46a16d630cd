"""Rigid wheel on soil by quadrature and bisection: an implementation independent of `terrain.wheel_soil`.

The stresses are those of the paper's Eqs 1, 4 and 5: linear from the entry θ_C to θ_m = θ_C/2 and from there to the
exit, where the normal stress is zero and the shear stress is the cohesion c. Load and torque are their integrals (Eqs
2 and 3) by Gauss–Legendre quadrature on either side of θ_m; the contact angle that carries a load is found by
bisection. The closed forms (Eqs 6 and 7) are not used. The torque is tabulated for speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)


@dataclass(frozen=True)
class Ground:
    """Soil and wheel; SI units, `stiffness` is k_c/w + k_φ in Pa/m^n."""

    cohesion_Pa: float
    friction_angle_rad: float
    shear_modulus_m: float
    stiffness: float
    exponent: float
    radius_m: float
    width_m: float


def _peaks(ground: Ground, angle: Array, slip: Array) -> tuple[Array, Array]:
    """Return normal and shear stress at θ_m [Pa], with the shear displacement at θ_m."""
    middle = angle / 2
    normal = ground.stiffness * (ground.radius_m * (np.cos(middle) - np.cos(angle))) ** ground.exponent
    moved_m = ground.radius_m * ((angle - middle) - (1 - slip) * (np.sin(angle) - np.sin(middle)))
    mobilised = np.sign(moved_m) * (1 - np.exp(-np.abs(moved_m) / ground.shear_modulus_m))
    return normal, (ground.cohesion_Pa + normal * np.tan(ground.friction_angle_rad)) * mobilised


def load_and_torque(ground: Ground, angle: Array, slip: Array) -> tuple[Array, Array]:
    """Return load [N] and torque [N·m] at a contact angle [rad] and slip (Eqs 2–5 by quadrature)."""
    normal, shear = _peaks(ground, angle, slip)
    load, torque = np.zeros_like(angle), np.zeros_like(angle)
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        part = (node + 1) / 2
        behind, front = part * angle / 2, angle / 2 * (1 + part)
        measure = weight / 2 * angle / 2
        for at, sigma, tau in (
            (behind, normal * part, ground.cohesion_Pa + (shear - ground.cohesion_Pa) * part),
            (front, normal * (1 - part), shear * (1 - part)),
        ):
            load += measure * (sigma * np.cos(at) + tau * np.sin(at))
            torque += measure * tau
    area = ground.radius_m * ground.width_m
    return area * load, area * ground.radius_m * torque


def contact(ground: Ground, load_N: Array, slip: Array) -> Array:
    """Return the contact angle that carries a load [rad], by bisection between 0 and π/2."""
    low, high = np.full(np.shape(load_N), 1e-4), np.full(np.shape(load_N), np.pi / 2)
    for _ in range(48):
        middle = (low + high) / 2
        enough = load_and_torque(ground, middle, slip)[0] >= load_N
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return (low + high) / 2


def sunk_deeper(ground: Ground, angle: Array, factor: Array) -> Array:
    """Return the contact angle after the sinkage increased by a factor [rad]: θ = arccos(1 − z/r) (Eq. 9)."""
    sinkage = (1 - np.cos(angle)) * factor
    return np.arccos(1 - np.minimum(sinkage, 1.0)) + 0 * ground.radius_m


class TorqueTable:
    """Torque [N·m] against load and slip for one ground: a bicubic spline with a relative error of about 1e-5."""

    def __init__(self, ground: Ground, slip_sinkage: float = 0.0) -> None:
        """Tabulate; `slip_sinkage` a > 0 multiplies the sinkage by (1 + a·i)/(1 − a·i/2) at slip i."""
        loads, slips = np.linspace(2.0, 150.0, 60), np.linspace(-0.15, 0.6, 50)
        load, slip = np.meshgrid(loads, slips, indexing="ij")
        angle = contact(ground, load, slip)
        if slip_sinkage:
            grows = np.clip(slip_sinkage * slip, 0, 1.5)
            angle = sunk_deeper(ground, angle, (1 + grows) / (1 - grows / 2))
        self._spline = RectBivariateSpline(loads, slips, load_and_torque(ground, angle, slip)[1])

    def __call__(self, load_N: Array, slip: Array) -> Array:
        """Return the torque [N·m], shape of the broadcast arguments; zero where the load is zero."""
        torque = self._spline.ev(np.clip(load_N, 2, 150), np.clip(slip, -0.15, 0.6))
        return np.where(np.asarray(load_N) == 0, 0.0, np.asarray(torque, np.float64))
