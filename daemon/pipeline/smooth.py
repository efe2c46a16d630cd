"""Removes momentary current drops without hiding a step: a one-sided outlier test, then a one-pole low-pass.

A sample of the driving torque that lies further below the median of the last `window_s` than `threshold` times the
window's spread (1.4826 × the median absolute deviation, which is σ for Gaussian noise) is a drop: the median
replaces it. A value that falls and stays low becomes the median itself after half a window at most, so a step is never
hidden, and one that is smaller than the threshold is not delayed at all. The low-pass then reduces the remaining noise.
Loads and slips have no drops; they go through the low-pass alone, which delays them as much as the torque.

Delay with the defaults, at any rate: with the noise of the paper's Table 4 a step is half through after 1.0 s and 90 %
through after 3.0 s (25 %) to 3.5 s (60 %); the low-pass alone takes as long. A step far outside the noise is delayed
by the median: 2.7 s and 5.1 s at worst. docs/decisions/016-smoothing.md compares alternatives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regolithd.daemon.pipeline.snapshot import WHEELS, Array, Mask

MAD_TO_STD = 1.4826
"""Median absolute deviation → standard deviation, for Gaussian noise."""

MIN_SPREAD = 0.02
"""Relative to the median: in a signal without noise, a change by the last digit must not count as a drop."""

MAX_SAMPLES = 45
"""In the median's window; at high rates only every n-th sample is used, which limits the computing time."""


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """The filtered values of six wheels, NaN where nothing arrived."""

    torque: Array
    load: Array
    slip: Array


class DropRejector:
    """Replaces momentary drops by the median; all arrays of shape (6,). A missing value (NaN) stays missing."""

    def __init__(self, rate_Hz: float, window_s: float, threshold: float) -> None:
        length = max(1, round(window_s * rate_Hz))
        self._every = -(-length // MAX_SAMPLES)
        self._recent = np.full((max(1, length // self._every // 2 * 2 + 1), WHEELS), np.nan)
        self._threshold = threshold
        self._count = 0
        self._middle = self._lowest = np.full(WHEELS, np.nan)  # of `_recent`, which changes with every n-th sample

    def reset(self, wheels: Mask) -> None:
        """Forget earlier samples of the wheels of a mask of shape (6,)."""
        self._recent[:, wheels] = np.nan
        self._update()

    def step(self, values: Array) -> Array:
        """Return the values without drops."""
        if self._threshold == 0:
            return values
        if self._count % self._every == 0:
            self._recent[self._count // self._every % len(self._recent)] = values
            self._update()
        self._count += 1
        return np.where(values < self._lowest, self._middle, values)  # NaN is not less than anything

    def _update(self) -> None:
        middle = _median(self._recent)
        spread = MAD_TO_STD * _median(np.abs(self._recent - middle))
        self._middle = middle
        self._lowest = middle - self._threshold * np.maximum(spread, MIN_SPREAD * np.abs(middle))


class LowPass:
    """A one-pole low-pass over `channels` × 6 values; its gain follows from the time since the last sample."""

    def __init__(self, channels: int, time_constant_s: float) -> None:
        self._time_constant_ns = time_constant_s * 1e9
        self._state = np.full((channels, WHEELS), np.nan)
        self._time_ns = np.zeros((channels, WHEELS))

    def reset(self, wheels: Mask) -> None:
        """Forget earlier samples of the wheels of a mask of shape (6,)."""
        self._state[:, wheels] = np.nan

    def step(self, time_ns: int, values: Array) -> Array:
        """Return the filtered values; where nothing arrived (NaN) the state waits, and NaN is returned."""
        if self._time_constant_ns == 0:
            return values
        elapsed_ns = np.maximum(time_ns - self._time_ns, 0.0)  # the clock may have been set back
        share = -np.expm1(-elapsed_ns / self._time_constant_ns)
        moved = np.where(np.isnan(self._state), values, self._state + share * (values - self._state))
        arrived = ~np.isnan(values)
        np.copyto(self._state, moved, where=arrived)
        np.copyto(self._time_ns, float(time_ns), where=arrived)
        return moved


class Smoother:
    """Drop rejection and low-pass, for the torque, the load and the slip of six wheels.

    Parameters
    ----------
    rate_Hz
        Nominal sampling rate: it fixes how many samples the window has.
    window_s, threshold
        Of the drop test; 0 turns it off.
    time_constant_s
        Of the low-pass; 0 turns it off.
    """

    def __init__(self, rate_Hz: float, window_s: float, threshold: float, time_constant_s: float) -> None:
        self._rejector = DropRejector(rate_Hz, window_s, threshold)
        self._low_pass = LowPass(3, time_constant_s)

    def reset(self, wheels: Mask) -> None:
        """Forget earlier samples of the wheels of a mask of shape (6,)."""
        self._rejector.reset(wheels)
        self._low_pass.reset(wheels)

    def step(self, time_ns: int, driving_torque: Array, load: Array, slip: Array) -> Smoothed:
        """Return the filtered values at `time_ns`. The torque is positive where it drives the wheel as it turns."""
        torque = self._rejector.step(driving_torque)
        return Smoothed(*self._low_pass.step(time_ns, np.array([torque, load, slip])))


def _median(window: Array) -> Array:
    """Return the median over time of what is not NaN, shape (6,); NaN where nothing is."""
    ordered = np.sort(window, axis=0)  # NaN goes last
    count = len(window) - np.isnan(ordered).sum(axis=0)
    low = np.maximum(count - 1, 0) // 2
    high = np.minimum(count // 2, len(window) - 1)
    wheel = np.arange(WHEELS)
    return 0.5 * (ordered[low, wheel] + ordered[np.maximum(low, np.where(count % 2, low, high)), wheel])
