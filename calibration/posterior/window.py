"""What a window of measurements at six wheels comes to: a few numbers a wheel, the same in training and on the rover.

NumPy only. A window is 1 to 40 instants half a second apart (`INTERVAL_S`; faster samples are averaged to that first).
Torque enters as the traction coefficient μ = T/(r W), in which load, radius and most of the soil's size cancel.

| feature | what it tells |
|---|---|
| log(load / 50 N) | how deep the wheel stands |
| slip | how far the soil is sheared |
| mean μ | the soil's answer |
| median μ | the same without momentary drops of current |
| log standard error of μ | how well it is known; of one or two instants, by the known noise |
| lag-1 autocorrelation of μ | how many instants are worth one |
| relative standard deviation of the load | how much of the noise is ground |
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import SOILS

Array = NDArray[np.float64]

INTERVAL_S = 0.5
LONGEST = 40
FEATURES = 7
KNOWN = 10
LEAST_ERROR, LEAST_SPREAD = 0.003, 0.01
"""Floors of the standard error of μ and of the load's spread: data quieter than in training count as that quiet."""

USUAL_TORQUE_Nm = 0.3
"""The torque at which the scatter of torque is told: one and the same, so that it does not tell of the soil."""

KNOWN_LOW = np.array([0.01, 0.0003, 0.003, 0.01, 0.001])
KNOWN_HIGH = np.array([0.10, 0.010, 0.030, 0.60, 0.060])
"""How well and how badly a rover may be known for the posterior, in the order of `CalibrationUncertainty`."""


@dataclass(frozen=True, slots=True)
class CalibrationUncertainty:
    """What is known beside the measurements: deviations of gain (relative), no-load current and slip; and the ground.

    The posterior widens with each of them. After a wheels-up spin the no-load current is known to about 1 mA, before
    it to 10 mA and worse; slip without a ground-speed sensor is a guess. `torque_noise_Nm` is the scatter of torque
    from one instant to the next at a wheel that pulls `USUAL_TORQUE_Nm`, which a single instant cannot show: by default
    a third of the current. `no_load_current_A` has been taken out of the torque, but not its share of the noise. `soil`
    is the class of `SOILS` that the ground is said to be nearest to, by a geologist or an earlier trench; the posterior
    then knows that much.
    """

    gain_relative_std: float = 0.03
    no_load_current_std_A: float = 0.001
    slip_std: float = 0.005
    torque_noise_Nm: float = 0.30
    no_load_current_A: float = 0.037
    soil: str | None = None

    def deviations(self) -> Array:
        """Return the five numbers, within what the posterior takes, shape (1, 5)."""
        deviations = (self.gain_relative_std, self.no_load_current_std_A, self.slip_std, self.torque_noise_Nm)
        return np.clip([[*deviations, self.no_load_current_A]], KNOWN_LOW, KNOWN_HIGH)

    def told(self) -> NDArray[np.intp]:
        """Return the class of soil that is told as its index in `SOILS`, shape (1,); −1 where none is."""
        return np.array([-1 if self.soil is None else list(SOILS).index(self.soil)])


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """Windows reduced to what the posterior takes.

    Attributes
    ----------
    wheels
        Shape (N, 6, `FEATURES`).
    mask
        Shape (N, 6): 1 where the wheel was measured, else 0.
    known
        Shape (N, `KNOWN`): logarithms of the five numbers of `CalibrationUncertainty` and of the instants; and
        the class of soil that is told as a one among four zeros, or zeros.
    """

    wheels: Array
    mask: Array
    known: Array


def reduce_windows(
    load_N: Array,
    slip: Array,
    torque_Nm: Array,
    known: Array,
    radius_m: float,
    told: NDArray[np.intp] | None = None,
) -> Windows:
    """Reduce windows of shape (N, instants, 6); NaN is "not measured".

    `known` has shape (N, 5), the numbers of `CalibrationUncertainty`; `told`, shape (N,), the class of soil or −1.
    """
    usable = np.isfinite(load_N) & np.isfinite(slip) & np.isfinite(torque_Nm) & (load_N > 0)
    count = usable.sum(axis=1)
    some = np.maximum(count, 1)

    def mean(values: Array) -> Array:
        return np.where(usable, values, 0.0).sum(axis=1) / some

    load = np.where(count > 0, mean(load_N), 1.0)
    coefficient = np.where(usable, torque_Nm, 0.0) / (radius_m * load[:, None])
    level = mean(coefficient)
    residual = np.where(usable, coefficient - level[:, None], 0.0)
    variance = (residual**2).sum(axis=1) / np.maximum(count - 1, 1)
    lagged = (residual[:, 1:] * residual[:, :-1]).sum(axis=1) / np.maximum((residual**2).sum(axis=1), 1e-12)
    expected = known[:, 3:4] / (radius_m * load * np.sqrt(some))
    error = np.maximum(np.where(count > 2, np.sqrt(variance / some), expected), LEAST_ERROR)
    wander = np.sqrt(mean((np.where(usable, load_N, 0.0) - load[:, None]) ** 2)) / load
    spread = np.maximum(wander, LEAST_SPREAD)
    features = [np.log(load / 50), mean(slip), level, _median(coefficient, usable), np.log(error), lagged, spread]
    instants = np.log(np.maximum(count.max(axis=1), 1))
    mask = (count > 0).astype(np.float64)
    wheels = np.stack(features, axis=-1) * mask[..., None]
    classes = np.zeros((len(known), len(SOILS)))
    if told is not None:
        classes[told >= 0, told[told >= 0]] = 1.0
    return Windows(wheels, mask, np.column_stack([np.log(known), instants, classes]))


def _median(values: Array, usable: NDArray[np.bool_]) -> Array:
    """Return the median over the instants that are usable; 0 where none is."""
    count = usable.sum(axis=1)
    ordered = np.sort(np.where(usable, values, np.inf), axis=1)
    upper = np.minimum(count // 2, values.shape[1] - 1)
    lower = np.maximum((count - 1) // 2, 0)
    pair = [np.take_along_axis(ordered, each[:, None], axis=1)[:, 0] for each in (lower, upper)]
    return np.where(count > 0, np.where(np.isfinite(pair[1]), (pair[0] + pair[1]) / 2, pair[0]), 0.0)
