"""Noise that is a function of where or when, and of a seed: asked twice at one place, it says the same.

Both kinds are drawn on a grid, in order, as far as somebody has asked. So the same seed gives the same numbers however
often, and at whatever instants, the grid is read.
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


class Wander:
    """Gaussian noise of unit variance with exponential correlation, several channels; linear between grid points.

    `length` is the correlation length, in whatever unit `at` is asked in; a quarter of it is the grid. With `keeps` the
    noise may be asked for at a place long past – a rover turns back – else only what is recent is kept.
    """

    def __init__(self, seed: np.random.SeedSequence, channels: int, length: float, *, keeps: bool = False) -> None:
        self._random = np.random.Generator(np.random.PCG64(seed))
        self._step = length / 4
        self._keep = math.exp(-self._step / length)
        self._keeps = keeps
        self._last = self._random.standard_normal(channels)
        self._blocks: list[Array | None] = []

    def at(self, place: float) -> Array:
        """Return all channels at `place`; what lies before 0 is as at 0."""
        position = max(place, 0.0) / self._step
        below = int(position)
        share = position - below
        # Between two correlated values the variance sags; the factor holds it at one.
        sag = math.sqrt((1 - share) ** 2 + share**2 + 2 * share * (1 - share) * self._keep)
        return ((1 - share) * self._row(below) + share * self._row(below + 1)) / sag

    def _row(self, number: int) -> Array:
        while number >= _BLOCK * len(self._blocks):
            self._extend()
        block = self._blocks[number // _BLOCK]
        if block is None:
            raise ValueError("this noise is only known from now on")
        return block[number % _BLOCK]

    def _extend(self) -> None:
        block = self._random.standard_normal((_BLOCK, len(self._last))) * math.sqrt(1 - self._keep**2)
        for number in range(_BLOCK):
            block[number] += self._keep * self._last
            self._last = block[number]
        self._blocks.append(block)
        if not self._keeps and len(self._blocks) > 2:
            self._blocks[-3] = None


class Drops:
    """Momentary drops, independent for each channel: 1 while one lasts, else 0."""

    def __init__(self, seed: np.random.SeedSequence, channels: int, per_s: float, duration_s: float) -> None:
        self._randoms = [np.random.Generator(np.random.PCG64(child)) for child in seed.spawn(channels)]
        self._pause_s = 1 / per_s if per_s else math.inf
        self._duration_s = duration_s
        self._starts = [[-math.inf] for _ in self._randoms]
        self._ends = [[-math.inf] for _ in self._randoms]

    def at(self, time_s: float) -> Array:
        """Return 1 for each channel that drops at this time."""
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
