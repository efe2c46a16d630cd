"""What a brake tells: the current that a torque takes, and so the drivetrain's efficiency against torque.

    I = I_0 + T (1 + λ T) / (f G),   η(T) = T / (κ ζ_PG ζ_HD I)

G is Eq. 11's gain, f the `gain_factor` and λ the `load_loss_per_Nm` that the daemon reads. A loss that does not grow
with the torque is no-load current; one that grows in proportion is the gain; λ is what bends the line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from regolithd.calibration.drivetrain.bench.line import BenchError

Array = NDArray[np.float64]

STEPS_TO_BEND, TORQUES_TO_BEND = 5, 4
"""How many steps, and different torques among them, a bent line needs; with fewer it is straight."""

SURE = 0.95
"""How sure the line must be bent for λ to be written; else it is zero, with the deviation that was found."""

UP_TO_Nm = 2.0
"""To what torque the wheel may be driven, which the formula must have an answer for."""


@dataclass(frozen=True, slots=True)
class Efficiency:
    """One wheel under a brake: values and standard deviations; `covariance`, (3, 3), is of the current's polynomial."""

    gain_factor: float
    gain_factor_std: float
    load_loss_per_Nm: float
    load_loss_std_per_Nm: float
    no_load_A: float
    no_load_std_A: float
    polynomial: Array
    covariance: Array
    bent: bool

    def line(self, torque_Nm: Array) -> Array:
        """Return the current that a torque takes [A]."""
        return _powers(torque_Nm) @ self.polynomial

    def line_std(self, torque_Nm: Array) -> Array:
        """Return the standard deviation of `line` [A]."""
        powers = _powers(torque_Nm)
        return np.sqrt(np.einsum("...i,ij,...j", powers, self.covariance, powers))

    def efficiency(self, torque_Nm: Array, ideal_gain_Nm_per_A: float) -> tuple[Array, Array]:
        """Return output over input power and its standard deviation; the ideal gain is κ ζ_PG ζ_HD."""
        current = self.line(torque_Nm)
        share = torque_Nm / (ideal_gain_Nm_per_A * current)
        return share, share * self.line_std(torque_Nm) / current


def fit_efficiency(torque_Nm: Array, current_A: Array, steps: Array, gain_Nm_per_A: float) -> Efficiency:
    """Return what one wheel's currents under a brake say; as in `fit_line`, the steps count and not the samples."""
    names = np.unique(steps)
    torque = np.array([torque_Nm[steps == name].mean() for name in names])
    current = np.array([current_A[steps == name].mean() for name in names])
    different = len(np.unique(torque))
    if len(names) < 3 or different < 2:
        raise BenchError(f"{len(names)} steps at {different} torques were found: brake with at least three")
    may_bend = len(names) >= STEPS_TO_BEND and different >= TORQUES_TO_BEND
    bend_std = 0.0
    fitted = _least_squares(torque, current, 3 if may_bend else 2)
    if may_bend:
        polynomial, covariance = fitted
        _, loss_std = _loss(polynomial, covariance)
        sure = student.ppf(0.5 + SURE / 2, len(names) - 3) * np.sqrt(covariance[2, 2])
        may_bend = bool(abs(polynomial[2]) > sure)
        if not may_bend:
            bend_std, fitted = loss_std, _least_squares(torque, current, 2)
    polynomial, covariance = fitted
    if polynomial[1] <= 0:
        raise BenchError("the current does not grow with the brake's torque")
    loss, loss_std = _loss(polynomial, covariance)
    if 1 + 2 * loss * max(UP_TO_Nm, torque.max()) <= 0:
        raise BenchError(f"the current would fall again below {UP_TO_Nm:g} N m: brake with larger torques as well")
    factor = 1 / (float(polynomial[1]) * gain_Nm_per_A)
    deviations = np.sqrt(np.diag(covariance))
    return Efficiency(
        gain_factor=factor,
        gain_factor_std=factor * float(deviations[1] / polynomial[1]),
        load_loss_per_Nm=loss,
        load_loss_std_per_Nm=loss_std if may_bend else bend_std,
        no_load_A=float(polynomial[0]),
        no_load_std_A=float(deviations[0]),
        polynomial=polynomial,
        covariance=covariance,
        bent=may_bend,
    )


def _powers(torque_Nm: Array) -> Array:
    return np.stack([np.ones_like(torque_Nm), torque_Nm, torque_Nm**2], axis=-1)


def _least_squares(torque: Array, current: Array, terms: int) -> tuple[Array, Array]:
    """Return a polynomial of so many terms and its covariance, both filled up with zeros to three."""
    design = _powers(torque)[:, :terms]
    found, *_ = np.linalg.lstsq(design, current, rcond=None)
    variance = np.sum((current - design @ found) ** 2) / (len(torque) - terms)
    polynomial, covariance = np.zeros(3), np.zeros((3, 3))
    polynomial[:terms] = found
    covariance[:terms, :terms] = variance * np.linalg.inv(design.T @ design)
    return polynomial, covariance


def _loss(polynomial: Array, covariance: Array) -> tuple[float, float]:
    """Return λ = a_2/a_1 and its standard deviation."""
    loss = polynomial[2] / polynomial[1]
    slope = np.array([0.0, -loss, 1.0]) / polynomial[1]
    return float(loss), float(np.sqrt(slope @ covariance @ slope))
