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
EXCHANGES_OF_ALL = 5
"""Exchanges of all powers that are 0 wrongly, before one at a time is exchanged (a choice: one to three are usual)."""
MOST_EXCHANGES = 60
"""Exchanges at most (a choice: of ten processes none needs half as many)."""
SMALL = 1e-4
"""Share of the largest power below which one may be 0: where the search for those that are 0 begins (a choice)."""
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

    def products(self, transformed: Array) -> Array:
        """Return sums of products of the coefficients of series in each band, shape (band, series, series).

        Parameters
        ----------
        transformed: cosine transforms of series that followed each other as the readings did, shape (series, reading)
        """
        bands = [transformed[:, start:end] for start, end in zip(self.edges[:-1], self.edges[1:], strict=True)]
        return np.array([of_band @ of_band.T for of_band in bands])


def likeliest_powers(shapes: Array, power: Array, free: Array, start: Array | None = None) -> Array:
    """Return the powers of processes, shape (course, process), that are likeliest for courses, each by itself.

    They are found by Fisher scoring with powers that are not below 0 (Bertsekas, 1982), of all courses together.

    Parameters
    ----------
    shapes: spectrum of each process of variance 1, shape (course, process, band)
    power, free: sums of squared coefficients, and their degrees of freedom, shape (course, band)
    start: where the search begins, shape (course, process)
    """
    variance = power.sum(axis=1) / np.maximum(free.sum(axis=1), RIDGE)
    equal = np.repeat(variance[:, None] / shapes.shape[1], shapes.shape[1], axis=1)
    powers = equal if start is None else np.maximum(start, RIDGE * equal)
    value, moving = minus_two_log_likelihood(spectra_of(shapes, powers), power, free), variance > 0
    for _ in range(MOST_STEPS):
        if not moving.any():
            break
        step, before = _step(shapes, powers, power, free), value
        left = moving
        for share in SHARES_OF_A_STEP:
            tried = np.where(left[:, None], powers + share * step, powers)
            reached = minus_two_log_likelihood(spectra_of(shapes, tried), power, free)
            better = left & (reached <= before)
            powers, value = np.where(better[:, None], tried, powers), np.where(better, reached, value)
            left = left & ~better
            if not left.any():
                break
        moving = moving & (before - value >= CONVERGED)
    return np.where(variance[:, None] > 0, powers, 0.0)


def spectra_of(shapes: Array, powers: Array) -> Array:
    """Return the spectrum of processes with these powers in each band, shape (course, band)."""
    return np.asarray((powers[:, None] @ shapes)[:, 0])


def minus_two_log_likelihood(level: Array, power: Array, free: Array) -> Array:
    """Return −2 ln of Whittle's likelihood of spectra (course, band), but for a constant, shape (course,)."""
    known = np.maximum(level, np.finfo(float).tiny)
    return np.where(level.min(axis=1) > 0, np.sum(free * np.log(known) + power / known, axis=1), np.inf)


def _step(shapes: Array, powers: Array, power: Array, free: Array) -> Array:
    """Return the step to the least of the quadratic that has the likelihood's slope and Fisher information here."""
    level = np.maximum(spectra_of(shapes, powers), np.finfo(float).tiny)
    relative = shapes / level[:, None]
    slope = (relative @ (free - power / level)[..., None])[..., 0]
    information = (relative * free[:, None]) @ relative.swapaxes(1, 2)
    diagonal = np.einsum("cpp->cp", information)
    diagonal *= 1 + RIDGE
    diagonal[diagonal == 0] = 1.0  # a process that no band shows stays as it is
    right = (information @ powers[..., None])[..., 0] - slope
    return _least_not_below_zero(information, right, powers > SMALL * powers.max(axis=1, keepdims=True)) - powers


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
    """Return the x, not below 0, for which x' matrix x / 2 − right' x is least, of each course.

    Those that are 0 are found by exchange, from a guess of those that are `above`. Exchanges of all that are wrong may
    go round in a circle, those of the last alone do not (Portugal, Júdice and Vicente, 1994).
    """
    for exchange in range(MOST_EXCHANGES):
        among = matrix * (above[:, :, None] & above[:, None])
        np.einsum("cpp->cp", among)[~above] = 1.0
        found = np.linalg.solve(among, np.where(above, right, 0.0)[..., None])[..., 0]
        wrong = np.where(above, found < 0, right - (matrix @ found[..., None])[..., 0] > 0)
        if not wrong.any():
            break
        if exchange >= EXCHANGES_OF_ALL:
            wrong &= np.cumsum(wrong[:, ::-1], axis=1)[:, ::-1] == 1
        above = above ^ wrong
    return np.maximum(found, 0.0)


def _times(slowest: float) -> Array:
    """Return correlation times [readings]: 0, and one in each octave from 1 on; sums are within 9 % of any other."""
    slowest = max(slowest, 2.0)
    return np.append(0.0, np.geomspace(1.0, slowest, int(np.ceil(np.log2(slowest))) + 1))


def _spectra(times: Array, frequencies: Array) -> Array:
    """Return the spectrum of a process of variance 1 with each time, shape (process, frequency)."""
    kept = np.exp(-1 / np.maximum(times, 1e-9))[:, None]
    return np.asarray((1 - kept**2) / np.abs(1 - kept * np.exp(-2j * np.pi * frequencies)) ** 2)
