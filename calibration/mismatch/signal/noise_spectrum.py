"""The spectrum of noise: white noise and first-order processes, fitted to the power in bands of frequency.

A sensor's noise is white noise and what wanders about it, each part forgotten within a time of its own. Its spectrum is
then a sum of those of first-order processes, whose powers maximise Whittle's likelihood (1953): the coefficients of a
discrete cosine transform are independent, and each has the spectrum as its variance. (Those of a Fourier transform are
not where the noise is slow: readings that end elsewhere than they began are a step to it.) What is slower than a share
of the recording passes too seldom for a spectrum to be told, and is looked for as structure.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

Array = NDArray[np.float64]

BAND = 1.06
"""Ratio of the frequencies at both ends of a band whose coefficients are taken together (a choice: the spectrum of a
first-order process changes by less than 12 % within one)."""
MOST_STEPS = 50
"""Steps of the powers at most (a choice: four to ten are usual)."""
CONVERGED = 1e-3
"""Fall of −2 ln of the likelihood in a step below which the powers are the likeliest (a choice: what is told gains a
thousand times as much)."""
SHARES_OF_A_STEP = tuple(0.5**power for power in range(20))
"""Shares of a step that are tried in turn until the likelihood rises, which the whole step nearly always does."""
MOST_EXCHANGES = 30
"""Exchanges of powers that are 0 at most (a choice: with two for each of fifteen none is left, but for rounding)."""
RIDGE = 1e-6
"""By what share the information of each power is raised, since spectra of neighbouring times are nearly the same."""


@dataclass(frozen=True, eq=False)
class Bands:
    """Coefficients of the cosine transform of readings that followed each other, some together.

    Attributes
    ----------
    edges: number of the first coefficient of each band, and how many readings there are
    times: correlation times of the processes whose spectra are fitted [readings], 0 for white noise, shape (process,)
    """

    edges: tuple[int, ...]
    times: Array

    @classmethod
    def of(cls, readings: int, thresholds: Thresholds = THRESHOLDS) -> Bands:
        """Return the bands of so many readings."""
        edges = [0, 1]
        while edges[-1] < readings:
            edges.append(min(max(edges[-1] + 1, int(edges[-1] * BAND)), readings))
        return cls(tuple(edges), _times(thresholds.slowest_noise_share * readings))

    def with_slowest(self, share: float) -> Bands:
        """Return the same bands of noise whose correlation time is up to this share of the readings."""
        return Bands(self.edges, _times(share * self.edges[-1]))

    @cached_property
    def count(self) -> Array:
        """Coefficients in each band, shape (band,)."""
        return np.diff(self.edges).astype(np.float64)

    @cached_property
    def shapes(self) -> Array:
        """Spectrum of a process of variance 1 with each time, in the middle of each band, shape (process, band)."""
        edges = np.array(self.edges, np.float64)
        return _spectra(self.times, (edges[:-1] + edges[1:] - 1) / 4 / self.edges[-1])

    def products(self, series: Array) -> Array:
        """Return sums of products of the series' coefficients in each band, shape (band, series, series).

        Parameters
        ----------
        series: that followed each other as the readings did, shape (series, reading)
        """
        transformed = cosine_transform(series)
        bands = [transformed[:, start:end] for start, end in zip(self.edges[:-1], self.edges[1:], strict=True)]
        return np.array([of_band @ of_band.T for of_band in bands])

    def fitted(self, power: Array, free: Array | None = None, start: NoiseSpectrum | None = None) -> NoiseSpectrum:
        """Return the spectrum that is likeliest for sums of squared coefficients, shape (band,).

        It is found by Fisher scoring with powers that are not below 0 (Bertsekas, 1982).

        Parameters
        ----------
        free: degrees of freedom of each sum, shape (band,); as many as there are coefficients unless stated
        start: where the search begins
        """
        free = self.count if free is None else free
        variance = float(np.sum(power) / np.sum(free)) if free.any() else 0.0
        if not variance > 0:
            return NoiseSpectrum(self, np.zeros(len(self.times)))
        equal = np.full(len(self.times), variance / len(self.times))
        powers = equal if start is None else np.maximum(start.powers, RIDGE * equal)
        value = self._minus_two_log(powers, power, free)
        for _ in range(MOST_STEPS):
            step, before = self._step(powers, power, free), value
            for share in SHARES_OF_A_STEP:
                value = self._minus_two_log(tried := powers + share * step, power, free)
                if value <= before:
                    powers = tried
                    break
            if not before - value >= CONVERGED:
                break
        return NoiseSpectrum(self, powers)

    def _minus_two_log(self, powers: Array, power: Array, free: Array) -> float:
        """Return −2 ln of Whittle's likelihood of powers, but for a constant."""
        level = powers @ self.shapes
        return float(free @ np.log(level) + np.sum(power / level)) if level.min() > 0 else np.inf

    def _step(self, powers: Array, power: Array, free: Array) -> Array:
        """Return the step to the least of the quadratic that has the likelihood's slope and Fisher information here."""
        level = powers @ self.shapes
        slope = self.shapes @ ((free - power / level) / level)
        relative = self.shapes / level
        information = (relative * free) @ relative.T
        information[np.diag_indices(len(powers))] *= 1 + RIDGE
        return _least_not_below_zero(information, information @ powers - slope, powers > 0) - powers


@dataclass(frozen=True, eq=False)
class NoiseSpectrum:
    """Powers of first-order processes: the variance of each, in the square of the readings' unit, shape (process,)."""

    bands: Bands
    powers: Array

    @cached_property
    def level(self) -> Array:
        """The spectrum in each band, shape (band,); that of white noise is its variance."""
        return np.asarray(self.powers @ self.bands.shapes)

    @property
    def log_determinant(self) -> float:
        """The logarithm of the determinant of the readings' covariance."""
        return float(self.bands.count @ np.log(self.level))


def cosine_transform(series: Array) -> Array:
    """Return the orthonormal discrete cosine transform (DCT-II) of series, shape (…, reading).

    One Fourier transform of the readings in another order (Makhoul, 1980), which needs no SciPy.
    """
    count = series.shape[-1]
    mixed = np.concatenate([series[..., ::2], series[..., 1::2][..., ::-1]], axis=-1)
    turned = np.fft.rfft(mixed, axis=-1) * np.exp(-0.5j * np.pi * np.arange(count // 2 + 1) / count)
    found = np.empty(series.shape)
    found[..., : count // 2 + 1] = turned.real
    found[..., count // 2 + 1 :] = -turned.imag[..., (count - 1) // 2 : 0 : -1]
    found *= np.sqrt(2 / count)
    found[..., 0] /= np.sqrt(2)
    return found


def _least_not_below_zero(matrix: Array, right: Array, above: NDArray[np.bool_]) -> Array:
    """Return the x, not below 0, for which x' matrix x / 2 − right' x is least.

    Those that are 0 are found by exchange, from a guess of those that are `above` (Portugal, Júdice and Vicente, 1994).
    """
    for _ in range(MOST_EXCHANGES):
        found, at = np.zeros(len(right)), np.flatnonzero(above)
        found[at] = np.linalg.solve(matrix[at[:, None], at], right[at])
        kept = np.where(above, found >= 0, right - matrix @ found > 0)
        if np.array_equal(kept, above):
            break
        above = kept
    return np.maximum(found, 0.0)


def _times(slowest: float) -> Array:
    """Return correlation times [readings]: 0, and one in each octave from 1 on; sums are within 9 % of any other."""
    slowest = max(slowest, 2.0)
    return np.append(0.0, np.geomspace(1.0, slowest, int(np.ceil(np.log2(slowest))) + 1))


def _spectra(times: Array, frequencies: Array) -> Array:
    """Return the spectrum of a process of variance 1 with each time, shape (process, frequency)."""
    kept = np.exp(-1 / np.maximum(times, 1e-9))[:, None]
    return np.asarray((1 - kept**2) / np.abs(1 - kept * np.exp(-2j * np.pi * frequencies)) ** 2)
