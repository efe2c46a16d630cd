"""Features of a window of measurements at six wheels: the posterior network's inputs, in training and on the rover.

NumPy only. A window is 1 to 40 instants, half a second apart (`INTERVAL_S`); faster samples are averaged to half-second
means first. Torque enters as the traction coefficient μ = T/(r W) [1], which depends little on load and radius.

| feature of each wheel | information |
|---|---|
| ln(load / 50 N) | sinkage |
| slip | shear displacement |
| mean μ | strength of the soil |
| median μ | the same, robust to momentary drops of current |
| ln standard error of μ | its precision; for one or two instants from the stated noise |
| lag-1 autocorrelation of μ | effective number of independent instants |
| relative standard deviation of the load | share of the noise that is due to the ground |
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import SOILS

Array = NDArray[np.float64]

INTERVAL_S = 0.5
"""Time between the instants of a window [s]."""
MAX_INSTANTS = 40
"""Largest number of instants in a window."""
FEATURES = 7
"""Features of each wheel."""
KNOWN = 10
"""Inputs that are common to the wheels: five of `CalibrationUncertainty`, the number of instants, four soil classes."""
MIN_STANDARD_ERROR, MIN_LOAD_STD = 0.003, 0.01
"""Lower limits of the standard error of μ and the load's relative standard deviation: the lowest in training."""

REFERENCE_TORQUE_Nm = 0.3
"""Torque at which the noise of the torque is stated [N·m]; a constant does not depend on the soil."""

UNCERTAINTY_LOW = np.array([0.01, 0.0003, 0.003, 0.01, 0.001])
UNCERTAINTY_HIGH = np.array([0.10, 0.010, 0.030, 0.60, 0.060])
"""Range of the numbers of `CalibrationUncertainty` in training, in its order."""


@dataclass(frozen=True, slots=True)
class CalibrationUncertainty:
    """Uncertainty of the calibration, noise, and prior knowledge of the soil, on which the posterior depends.

    Attributes
    ----------
    gain_relative_std
        Relative standard deviation of the drivetrain's gain [1].
    no_load_current_std_A
        Standard deviation of the no-load current [A]: about 1 mA after `regolithd calibrate wheels-up`, else 10 mA or
        more.
    slip_std
        Standard deviation of the slip's systematic error [1].
    torque_noise_Nm
        Standard deviation of the torque between instants at `REFERENCE_TORQUE_Nm` [N·m]. One instant does not show it;
        the default corresponds to a third of the current.
    no_load_current_A
        No-load current [A]. It is subtracted before the torque is computed, but contributes to the noise.
    soil
        Class of `SOILS` that the soil is known to be nearest to, or None.
    """

    gain_relative_std: float = 0.03
    no_load_current_std_A: float = 0.001
    slip_std: float = 0.005
    torque_noise_Nm: float = 0.30
    no_load_current_A: float = 0.037
    soil: str | None = None

    def deviations(self) -> Array:
        """Return the five numbers, clipped to the range of the training, shape (1, 5)."""
        deviations = (self.gain_relative_std, self.no_load_current_std_A, self.slip_std, self.torque_noise_Nm)
        return np.clip([[*deviations, self.no_load_current_A]], UNCERTAINTY_LOW, UNCERTAINTY_HIGH)

    def soil_index(self) -> NDArray[np.intp]:
        """Return the index of `soil` in `SOILS`, shape (1,); −1 for None."""
        return np.array([-1 if self.soil is None else list(SOILS).index(self.soil)])


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """Features of N windows.

    Attributes
    ----------
    wheels
        Shape (N, 6, `FEATURES`).
    mask
        Shape (N, 6): 1 where the wheel was measured, else 0.
    known
        Shape (N, `KNOWN`): logarithms of the five numbers of `CalibrationUncertainty` and of the number of instants;
        the known class of soil, one-hot, or zeros.
    """

    wheels: Array
    mask: Array
    known: Array


def reduce_windows(
    load_N: Array,
    slip: Array,
    torque_Nm: Array,
    uncertainty: Array,
    radius_m: float,
    soil_index: NDArray[np.intp] | None = None,
) -> Windows:
    """Return the features of N windows.

    Parameters
    ----------
    load_N, slip, torque_Nm
        Load W [N], slip [1] and torque T [N·m], shape (N, instants, 6); NaN where not measured.
    uncertainty
        The five numbers of `CalibrationUncertainty`, shape (N, 5).
    radius_m
        Wheel radius r [m].
    soil_index
        Index of the known soil class in `SOILS`, or −1, shape (N,); None if no class is known.
    """
    usable = np.isfinite(load_N) & np.isfinite(slip) & np.isfinite(torque_Nm) & (load_N > 0)
    count = usable.sum(axis=1)
    divisor = np.maximum(count, 1)

    def mean(values: Array) -> Array:
        return np.where(usable, values, 0.0).sum(axis=1) / divisor

    load = np.where(count > 0, mean(load_N), 1.0)
    coefficient = np.where(usable, torque_Nm, 0.0) / (radius_m * load[:, None])
    level = mean(coefficient)
    residual = np.where(usable, coefficient - level[:, None], 0.0)
    variance = (residual**2).sum(axis=1) / np.maximum(count - 1, 1)
    lagged = (residual[:, 1:] * residual[:, :-1]).sum(axis=1) / np.maximum((residual**2).sum(axis=1), 1e-12)
    expected = uncertainty[:, 3:4] / (radius_m * load * np.sqrt(divisor))
    error = np.maximum(np.where(count > 2, np.sqrt(variance / divisor), expected), MIN_STANDARD_ERROR)
    load_std = np.sqrt(mean((np.where(usable, load_N, 0.0) - load[:, None]) ** 2)) / load
    spread = np.maximum(load_std, MIN_LOAD_STD)
    features = [np.log(load / 50), mean(slip), level, _median(coefficient, usable), np.log(error), lagged, spread]
    instants = np.log(np.maximum(count.max(axis=1), 1))
    mask = (count > 0).astype(np.float64)
    wheels = np.stack(features, axis=-1) * mask[..., None]
    classes = np.zeros((len(uncertainty), len(SOILS)))
    if soil_index is not None:
        classes[soil_index >= 0, soil_index[soil_index >= 0]] = 1.0
    return Windows(wheels, mask, np.column_stack([np.log(uncertainty), instants, classes]))


def _median(values: Array, usable: NDArray[np.bool_]) -> Array:
    """Return the median over the usable instants; 0 where there is none."""
    count = usable.sum(axis=1)
    ordered = np.sort(np.where(usable, values, np.inf), axis=1)
    upper = np.minimum(count // 2, values.shape[1] - 1)
    lower = np.maximum((count - 1) // 2, 0)
    pair = [np.take_along_axis(ordered, each[:, None], axis=1)[:, 0] for each in (lower, upper)]
    return np.where(count > 0, np.where(np.isfinite(pair[1]), (pair[0] + pair[1]) / 2, pair[0]), 0.0)
