"""Random functions of place or time: repeated evaluation at one place returns the same value.

Values are drawn on a grid, in order, as far as they are needed. Hence the same seed gives the same values wherever and
however often the function is evaluated.
"""

from __future__ import annotations

import bisect
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_BLOCK = 256


class CorrelatedNoise:
    """Gaussian noise of unit variance with exponential autocorrelation (Ornstein–Uhlenbeck), several channels.

    `length` is the correlation length, in the unit of `at`'s argument; the grid spacing is a quarter of it, and values
    between grid points are interpolated. With `keeps` the whole history is kept, so that a rover that turns back finds
    the same terrain; without it, only the last two blocks of 256 grid points.
    """

    def __init__(self, seed: np.random.SeedSequence, channels: int, length: float, *, keeps: bool = False) -> None:
        self._random = np.random.Generator(np.random.PCG64(seed))
        self._step = length / 4
        self._keep = math.exp(-self._step / length)
        self._keeps = keeps
        self._last = self._random.standard_normal(channels)
        self._blocks: list[Array | None] = []

    def at(self, place: float) -> Array:
        """Return all channels, shape (channels,), at `place` ≥ 0; a negative place gives the value at 0."""
        position = max(place, 0.0) / self._step
        below = int(position)
        share = position - below
        # Interpolation reduces the variance between grid points; dividing by its root restores unit variance.
        std = math.sqrt((1 - share) ** 2 + share**2 + 2 * share * (1 - share) * self._keep)
        return ((1 - share) * self._row(below) + share * self._row(below + 1)) / std

    def _row(self, number: int) -> Array:
        while number >= _BLOCK * len(self._blocks):
            self._extend()
        block = self._blocks[number // _BLOCK]
        if block is None:
            raise ValueError("this part of the noise is no longer kept (keeps=False)")
        return block[number % _BLOCK]

    def _extend(self) -> None:
        block = self._random.standard_normal((_BLOCK, len(self._last))) * math.sqrt(1 - self._keep**2)
        for number in range(_BLOCK):
            block[number] += self._keep * self._last
            self._last = block[number]
        self._blocks.append(block)
        if not self._keeps and len(self._blocks) > 2:
            self._blocks[-3] = None


class MomentaryDrops:
    """Momentary drops, independent for each channel, as a function of time [s].

    Pauses and durations are exponentially distributed, with means 1 / `per_s` and `duration_s`; `per_s` = 0: no drops.
    """

    def __init__(self, seed: np.random.SeedSequence, channels: int, per_s: float, duration_s: float) -> None:
        self._randoms = [np.random.Generator(np.random.PCG64(child)) for child in seed.spawn(channels)]
        self._pause_s = 1 / per_s if per_s else math.inf
        self._duration_s = duration_s
        self._starts = [[-math.inf] for _ in self._randoms]
        self._ends = [[-math.inf] for _ in self._randoms]

    def at(self, time_s: float) -> Array:
        """Return 1 for each channel that is in a drop at this time, else 0; shape (channels,)."""
        return np.array([self._drops(channel, time_s) for channel in range(len(self._randoms))])

    def _drops(self, channel: int, time_s: float) -> float:
        random, starts, ends = self._randoms[channel], self._starts[channel], self._ends[channel]
        if math.isinf(self._pause_s):
            return 0.0
        while starts[-1] <= time_s:
            starts.append(max(ends[-1], 0.0) + random.exponential(self._pause_s))
            ends.append(starts[-1] + random.exponential(self._duration_s))
        place = bisect.bisect_right(starts, time_s) - 1
        return float(time_s < ends[place])
