"""Removes momentary drops without hiding a step: a trailing median, then a one-pole low-pass.

The median of the last `window_s` ignores whatever lasts less than half of it, however deep; a step comes through it
whole, half a window late. The low-pass then takes the noise that is left. Together they delay a step by
(n − 1)/2 sample periods, n the window's samples, to the first movement, and by `time_constant_s` more to 63 % of it.
Why this and no other: docs/decisions/, "Smoothing".
"""

from __future__ import annotations

import numpy as np

from daemon.snapshot import WHEELS, Array, Mask


class Smoother:
    """Filters `channels` values for each of six wheels; a missing value (NaN) gives NaN and leaves the state alone.

    Parameters
    ----------
    channels
        How many values each wheel has.
    rate_Hz
        Nominal sampling rate: it fixes how many samples the median looks at (an odd number).
    window_s
        Length of the median [s]; less than three samples turn it off.
    time_constant_s
        Of the low-pass [s]; 0 turns it off.
    """

    def __init__(self, channels: int, rate_Hz: float, window_s: float, time_constant_s: float) -> None:
        self.samples = max(1, round(window_s * rate_Hz) // 2 * 2 + 1) if window_s * rate_Hz >= 2.5 else 1
        self._time_constant_ns = time_constant_s * 1e9
        self._forget_after_ns = max(window_s, 3 * time_constant_s, 2 / rate_Hz) * 1e9
        self._recent = np.full((self.samples, channels, WHEELS), np.nan)
        self._next = 0
        self._state = np.full((channels, WHEELS), np.nan)
        self._time_ns = np.zeros((channels, WHEELS), np.int64)

    def reset(self, wheels: Mask) -> None:
        """Forget what was before, for the wheels of a mask of shape (6,)."""
        self._recent[:, :, wheels] = np.nan
        self._state[:, wheels] = np.nan

    def step(self, time_ns: int, values: Array) -> Array:
        """Return the filtered values at `time_ns`; both arrays of shape (channels, 6)."""
        arrived = ~np.isnan(values)
        elapsed = time_ns - self._time_ns
        if (gap := (elapsed > self._forget_after_ns) & arrived).any():
            self._recent[:, gap] = np.nan
            self._state[gap] = np.nan
        self._recent[self._next] = values
        self._next = (self._next + 1) % self.samples
        middle = self._median()
        share = -np.expm1(-elapsed / self._time_constant_ns) if self._time_constant_ns else np.ones_like(values)
        moved = self._state + share * (middle - self._state)
        state = np.where(np.isnan(self._state), middle, moved)
        np.copyto(self._state, state, where=arrived)
        np.copyto(self._time_ns, time_ns, where=arrived)
        return np.where(arrived, self._state, np.nan)

    def _median(self) -> Array:
        """Return the median over time of what arrived; the lower of the two middle ones is averaged with the upper."""
        if self.samples == 1:
            return self._recent[0]
        ordered = np.sort(self._recent, axis=0)  # NaN goes last
        count = self.samples - np.isnan(ordered).sum(axis=0)
        low = np.maximum(count - 1, 0) // 2
        high = np.minimum(count // 2, self.samples - 1)
        pair = np.take_along_axis(ordered, np.stack([low, high]), axis=0)
        return 0.5 * (pair[0] + pair[1])
