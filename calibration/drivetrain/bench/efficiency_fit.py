"""Efficiency of a drivetrain against torque, fitted to the motor currents under a brake.

    I = I_0 + T (1 + λ T) / (f G),   η(T) = T / (κ ζ_PG ζ_HD I)

A quadratic polynomial in the torque T is fitted to the current I. Its constant term is the no-load current I_0, its
linear term gives the gain factor f (G is the gain of Eq. 11), and the ratio of the quadratic to the linear term is the
load loss λ. If λ is not significantly different from zero, a straight line is fitted and λ is zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from regolithd.calibration.drivetrain.bench.line_fit import BenchError

Array = NDArray[np.float64]

STEPS_FOR_LOAD_LOSS, TORQUES_FOR_LOAD_LOSS = 5, 4
"""Least number of steps, and of different torques, for which a load loss is fitted."""

CONFIDENCE = 0.95
"""Confidence (two-sided t-test) at which λ must differ from zero; otherwise λ is zero with the fitted deviation."""

LARGEST_TORQUE_Nm = 2.0
"""Largest torque in operation [N·m]; the fitted current must increase up to it."""


@dataclass(frozen=True, slots=True)
class EfficiencyFit:
    """Fit of one wheel: constants with standard deviations.

    Attributes
    ----------
    polynomial, covariance
        Coefficients of I(T), constant first, shape (3,), and their covariance, shape (3, 3).
    load_dependent
        Whether λ differs significantly from zero.
    """

    gain_factor: float
    gain_factor_std: float
    load_loss_per_Nm: float
    load_loss_std_per_Nm: float
    no_load_A: float
    no_load_std_A: float
    polynomial: Array
    covariance: Array
    load_dependent: bool

    def line(self, torque_Nm: Array) -> Array:
        """Return the fitted current at a torque [A]."""
        return _powers(torque_Nm) @ self.polynomial

    def line_std(self, torque_Nm: Array) -> Array:
        """Return the standard deviation of `line` [A]."""
        powers = _powers(torque_Nm)
        return np.sqrt(np.einsum("...i,ij,...j", powers, self.covariance, powers))

    def efficiency(self, torque_Nm: Array, ideal_gain_Nm_per_A: float) -> tuple[Array, Array]:
        """Return η(T) [1] and its standard deviation; the ideal gain is κ ζ_PG ζ_HD [N·m/A]."""
        current = self.line(torque_Nm)
        share = torque_Nm / (ideal_gain_Nm_per_A * current)
        return share, share * self.line_std(torque_Nm) / current


def fit_efficiency(torque_Nm: Array, current_A: Array, steps: Array, gain_Nm_per_A: float) -> EfficiencyFit:
    """Fit the efficiency of one wheel to the means of the steps, as in `line_fit.fit_line`.

    Parameters
    ----------
    torque_Nm, current_A
        Torque of the brake [N·m] and motor current [A], not negative, shape (samples,).
    steps
        Number of the step that each sample belongs to, same shape.
    gain_Nm_per_A
        Gain G of Eq. 11 [N·m/A].

    Raises
    ------
    BenchError
        There are fewer than three steps or two torques, or the current does not increase with the torque.
    """
    names = np.unique(steps)
    torque = np.array([torque_Nm[steps == name].mean() for name in names])
    current = np.array([current_A[steps == name].mean() for name in names])
    different = len(np.unique(torque))
    if len(names) < 3 or different < 2:
        raise BenchError(f"{len(names)} steps at {different} torques were found: brake with at least three")
    load_dependent = len(names) >= STEPS_FOR_LOAD_LOSS and different >= TORQUES_FOR_LOAD_LOSS
    insignificant_std = 0.0
    fitted = _least_squares(torque, current, 3 if load_dependent else 2)
    if load_dependent:
        polynomial, covariance = fitted
        _, loss_std = _loss(polynomial, covariance)
        critical = student.ppf(0.5 + CONFIDENCE / 2, len(names) - 3) * np.sqrt(covariance[2, 2])
        load_dependent = bool(abs(polynomial[2]) > critical)
        if not load_dependent:
            insignificant_std, fitted = loss_std, _least_squares(torque, current, 2)
    polynomial, covariance = fitted
    if polynomial[1] <= 0:
        raise BenchError("the current does not grow with the brake's torque")
    loss, loss_std = _loss(polynomial, covariance)
    if 1 + 2 * loss * max(LARGEST_TORQUE_Nm, torque.max()) <= 0:
        raise BenchError(
            f"the fitted current decreases below {LARGEST_TORQUE_Nm:g} N m: brake with larger torques as well"
        )
    factor = 1 / (float(polynomial[1]) * gain_Nm_per_A)
    deviations = np.sqrt(np.diag(covariance))
    return EfficiencyFit(
        gain_factor=factor,
        gain_factor_std=factor * float(deviations[1] / polynomial[1]),
        load_loss_per_Nm=loss,
        load_loss_std_per_Nm=loss_std if load_dependent else insignificant_std,
        no_load_A=float(polynomial[0]),
        no_load_std_A=float(deviations[0]),
        polynomial=polynomial,
        covariance=covariance,
        load_dependent=load_dependent,
    )


def _powers(torque_Nm: Array) -> Array:
    return np.stack([np.ones_like(torque_Nm), torque_Nm, torque_Nm**2], axis=-1)


def _least_squares(torque: Array, current: Array, terms: int) -> tuple[Array, Array]:
    """Return the fitted polynomial of `terms` coefficients and its covariance, padded with zeros to three."""
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
