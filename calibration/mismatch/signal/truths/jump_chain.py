"""A truth that keeps its value for a while and then takes another: a hidden Markov chain.

From one instant to the next the truth stays where it is with a probability, the `persistence`, and is else drawn anew
from a density: a speed's acceleration in ramps, dwells and cruises, a load of few levels, a command with plateaus. Its
correlation falls exponentially, as that of a first-order autoregression does, so that the two are told apart by all
else only. Mean and variance of the truth given all readings come from the forward and backward recursions (Rabiner,
1989), density and persistence from the expected draws (Baum and Welch).

The recursions need each instant's result for the next. They run over many windows of the recording at once, each with
a lead before and after it, from which nothing is used: what was read further away hardly counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.truths.mixing_density import MixingDensity, cut_off

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CORE = 256
"""Instants of a window of which results are used."""
LEAD = 32
"""Instants before and after them (a choice: the mean of 65 readings has an eighth of one reading's error)."""
MOST_WINDOWS = 64
"""Windows at once: their chances take some 30 megabytes."""
FITS = 2
"""Rounds in which density and persistence are fitted (a choice: both begin at good values)."""
GREATEST_PERSISTENCE = 0.9999
"""Persistence is at most this: one draw in ten thousand instants."""
WEIGHT_BEFORE = 1e-3
"""The density before a round counts as so many draws: a value that was never drawn stays possible."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Overlapping windows of one column, each of LEAD + CORE + LEAD instants, of shape (instant, window).

    Attributes
    ----------
    readings: NaN where not known, and beyond the recording
    begins: where a run begins anew
    used: the core's instants that the recording has
    rows: the recording's instants of the cores, one window after the other, shape (row,)
    """

    readings: Array
    begins: Mask
    used: Mask
    rows: NDArray[np.int64]

    def parts(self) -> list[Windows]:
        """Return some windows at a time."""
        parts, given = [], 0
        for first in range(0, self.readings.shape[1], MOST_WINDOWS):
            some = np.s_[:, first : first + MOST_WINDOWS]
            until = given + int(self.used[some].sum())
            parts.append(Windows(self.readings[some], self.begins[some], self.used[some], self.rows[given:until]))
            given = until
        return parts


def windows_of(readings: Array, starts: NDArray[np.int64], most: int) -> Windows:
    """Return windows of readings (time,) whose runs begin at `starts`: all, or so many, evenly spread."""
    count = -(-len(readings) // CORE)
    wanted = np.arange(count) if count <= most else np.linspace(0, count - 1, most).astype(np.int64)
    rows = wanted * CORE + np.arange(-LEAD, CORE + LEAD)[:, None]
    inside = (rows >= 0) & (rows < len(readings))
    clipped = np.clip(rows, 0, len(readings) - 1)
    used = inside.copy()
    used[:LEAD] = used[LEAD + CORE :] = False
    begins = np.zeros(len(readings), np.bool_)
    begins[starts] = True
    return Windows(np.where(inside, readings[clipped], np.nan), begins[clipped] & inside, used, rows.T[used.T])


@dataclass(frozen=True, eq=False)
class JumpChain:
    """What the truth's values are, how long they last, and the readings' standard error."""

    density: MixingDensity
    persistence: float
    deviation: float

    def fitted(self, windows: Windows) -> JumpChain:
        """Return the chain with density and persistence that these windows' readings make more likely."""
        density, persistence = self.density, self.persistence
        for _ in range(FITS):
            chain = JumpChain(density, persistence, self.deviation)
            draws = np.sum([chain.draws(part) for part in windows.parts()], axis=0)
            persistence = float(np.clip(1 - draws.sum() / len(windows.rows), 0.0, GREATEST_PERSISTENCE))
            weight = draws + WEIGHT_BEFORE * density.weight
            density = MixingDensity(density.at, weight / weight.sum(), density.spread)
        return JumpChain(density.without_negligible(), persistence, self.deviation)

    def posterior(self, windows: Windows) -> tuple[Array, Array]:
        """Return mean and variance of the truth at the windows' rows, given the readings."""
        parts = []
        for part in windows.parts():
            filtered, chance = self._recursions(part)
            chance = np.multiply(filtered, chance, out=chance)
            error = np.where(np.isfinite(part.readings), self.deviation**2, np.inf)[..., None]
            at_values = self.density.moments(np.nan_to_num(part.readings)[..., None], error)
            moments = np.einsum("twv,ktwv->twk", chance, at_values)
            parts.append(moments.transpose(1, 0, 2)[part.used.T])
        mean, square = np.concatenate(parts).T
        return mean, np.maximum(square - mean**2, 0.0)

    def draws(self, windows: Windows) -> Array:
        """Return how often each value is expected to have been drawn, shape (value,)."""
        filtered, after = self._recursions(windows)
        drawn = (1 - self.persistence) * self.density.weight
        share = drawn / (drawn + self.persistence * filtered[:-1])
        share = np.where(windows.begins[1:, :, None], 1.0, share) * windows.used[1:, :, None]
        return np.einsum("twv,twv,twv->v", share, filtered[1:], after[1:])

    def _recursions(self, windows: Windows) -> tuple[Array, Array]:
        """Return the values' chances given readings up to each, and the factors that those after it bring.

        Both of shape (instant, window, value); their product is the chances given all readings.
        """
        likelihood = self._likelihood(windows.readings)
        filtered, after = np.empty(likelihood.shape), np.empty(likelihood.shape)
        weight, total = self.density.weight, np.empty(windows.readings.shape)
        drawn, before = (1 - self.persistence) * weight, np.broadcast_to(weight, likelihood.shape[1:])
        begun = np.logical_or.reduce(windows.begins, axis=1).tolist()
        # The arrays are small, and the steps many: each is written where it stays, without arrays in between.
        for t in range(len(likelihood)):
            chance = np.multiply(before, self.persistence, out=filtered[t])
            chance += drawn
            if begun[t]:
                chance[windows.begins[t]] = weight
            chance *= likelihood[t]
            np.add.reduce(chance, axis=1, out=total[t])
            chance /= total[t][:, None]
            before = chance
        after[-1] = 1.0
        for t in range(len(likelihood) - 1, 0, -1):
            seen = after[t] / total[t][:, None]
            seen *= likelihood[t]
            np.multiply(seen, self.persistence, out=after[t - 1])
            after[t - 1] += (seen @ drawn)[:, None]
            if begun[t]:
                after[t - 1][windows.begins[t]] = 1.0
        return filtered, after

    def _likelihood(self, readings: Array) -> Array:
        """Return each value's likelihood, shape (instant, window, value), in proportion; 1 where nothing is known."""
        known = np.isfinite(readings)[..., None]
        likelihood = cut_off(self.density.log_likelihood(np.nan_to_num(readings)[..., None], self.deviation**2))
        return np.where(known, likelihood, 1.0)
