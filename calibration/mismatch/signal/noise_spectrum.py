"""How likely a residual is as noise: white noise and first-order processes, fitted to its periodogram.

A sensor's noise is white noise and what wanders about it, each part forgotten within a time of its own. Its spectrum is
then a sum of those of first-order processes, whose powers maximise Whittle's likelihood (1953): each ordinate of the
periodogram is exponentially distributed about the spectrum. What is slower than `slowest_noise_share` of the recording
passes too seldom for a spectrum to be told, and is looked for as structure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

BAND = 1.06
"""Ratio of the frequencies at both ends of a band whose ordinates are averaged (a choice: the spectrum of a first-order
process changes by less than 12 % within one)."""
STEPS = 200
"""Iterations of the powers (a choice: with ten times as many, what eight columns gain in 6000 readings changes by 1.8
at most)."""
GENERALISED = 2
"""Times that columns are fitted, each with the spectrum of what was left before (a choice: a third changes that by less
than 0.1)."""
LEAST_EIGENVALUE = 1e-9
"""Share of the largest eigenvalue below which a combination of columns is rounding."""
OF_THE_MEAN = 0.5
"""Ordinates that the frequency 0 counts for: it has one degree of freedom, any other has two."""
FEWEST_READINGS = 64
"""Readings below which a course has no spectrum (a choice)."""


@dataclass(frozen=True, eq=False)
class NoiseSpectrum:
    """Powers of first-order processes.

    Attributes
    ----------
    times: correlation times [readings], 0 for white noise, shape (process,)
    powers: variance of each, in the square of the readings' unit, shape (process,)
    minus_two_log_likelihood: of the readings, up to a constant
    """

    times: Array
    powers: Array
    minus_two_log_likelihood: float

    def at(self, frequencies: Array) -> Array:
        """Return the spectrum at frequencies [cycles per reading]; that of white noise is its variance."""
        return np.asarray(self.powers @ _spectra(self.times, frequencies))


def fitted_spectrum(values: Array, thresholds: Thresholds = THRESHOLDS) -> NoiseSpectrum:
    """Return the spectrum of readings that followed each other, shape (reading,)."""
    times = _times(thresholds.slowest_noise_share * len(values))
    frequency, mean, count = _bands(values)
    shapes, variance = _spectra(times, frequency), float(np.mean(values**2))
    if not variance > 0:
        return NoiseSpectrum(times, np.zeros(len(times)), 0.0)
    powers = np.full(len(times), variance / len(times))
    for _ in range(STEPS):
        # Each step raises the likelihood (Févotte and Idier, 2011, of the Itakura-Saito divergence).
        spectrum = powers @ shapes
        powers = powers * np.sqrt((shapes @ (count * mean / spectrum**2)) / (shapes @ (count / spectrum)))
    spectrum = powers @ shapes
    return NoiseSpectrum(times, powers, 2 * float(count @ (np.log(spectrum) + mean / spectrum)))


def gain_of_columns(courses: Sequence[Array], columns: Sequence[Array], thresholds: Thresholds = THRESHOLDS) -> float:
    """Return what columns gain in twice the log likelihood of noise with a spectrum of its own in each course.

    Courses that are too short to have a spectrum, or that are 0, are left out.

    Parameters
    ----------
    courses: readings that followed each other, each of shape (reading,)
    columns: what is fitted to each by generalised least squares, with the same coefficients, shape (column, reading)
    """
    known = [index for index, values in enumerate(courses) if len(values) >= FEWEST_READINGS and values.any()]
    courses, columns = [courses[index] for index in known], [columns[index] for index in known]
    if not courses:
        return 0.0
    spectra = before = [fitted_spectrum(values, thresholds) for values in courses]
    transformed = [
        (np.fft.rfft(of_course), np.fft.rfft(values)) for values, of_course in zip(courses, columns, strict=True)
    ]
    for _ in range(GENERALISED):
        coefficients = _generalised_least_squares(transformed, [len(values) for values in courses], spectra)
        left = [values - coefficients @ of_course for values, of_course in zip(courses, columns, strict=True)]
        spectra = [fitted_spectrum(values, thresholds) for values in left]
    return sum(
        each.minus_two_log_likelihood - now.minus_two_log_likelihood for each, now in zip(before, spectra, strict=True)
    )


def _generalised_least_squares(
    transformed: Sequence[tuple[Complex, Complex]], readings: Sequence[int], spectra: Sequence[NoiseSpectrum]
) -> Array:
    """Return the coefficients, shape (column,), each frequency weighted by the noise there.

    Parameters
    ----------
    transformed: columns [column, frequency] and readings [frequency] of each course
    readings: number of readings of each
    """
    columns = len(transformed[0][0])
    matrix, moment = np.zeros((columns, columns)), np.zeros(columns)
    for (amplitudes, measured), count, spectrum in zip(transformed, readings, spectra, strict=True):
        frequencies = np.asarray(np.fft.rfftfreq(count), np.float64)
        weighted = amplitudes.conj() / spectrum.at(frequencies)
        weighted[:, 0] *= OF_THE_MEAN
        matrix += (weighted @ amplitudes.T).real
        moment += (weighted @ measured).real
    return np.asarray(np.linalg.pinv(matrix, rcond=LEAST_EIGENVALUE, hermitian=True) @ moment)


def _times(slowest: float) -> Array:
    """Return correlation times [readings]: 0, and one in each octave from 1 on; sums are within 9 % of any other."""
    slowest = max(slowest, 2.0)
    return np.append(0.0, np.geomspace(1.0, slowest, int(np.ceil(np.log2(slowest))) + 1))


def _spectra(times: Array, frequencies: Array) -> Array:
    """Return the spectrum of a process of variance 1 with each time, shape (process, frequency)."""
    kept = np.exp(-1 / np.maximum(times, 1e-9))[:, None]
    return np.asarray((1 - kept**2) / np.abs(1 - kept * np.exp(-2j * np.pi * frequencies)) ** 2)


def _bands(values: Array) -> tuple[Array, Array, Array]:
    """Return frequency [cycles per reading], mean of the periodogram and number of ordinates of each band."""
    power = np.abs(np.fft.rfft(values)) ** 2 / len(values)
    last = (len(values) - 1) // 2
    edges = [1]
    while edges[-1] <= last:
        edges.append(max(edges[-1] + 1, int(edges[-1] * BAND)))
    edges[-1] = last + 1
    starts, ends = np.array(edges[:-1]), np.array(edges[1:])
    count = (ends - starts).astype(np.float64)
    mean = np.add.reduceat(power[1 : last + 1], starts - 1) / count
    frequency = (starts + ends - 1) / 2 / len(values)
    return np.append(0.0, frequency), np.append(power[0], mean), np.append(OF_THE_MEAN, count)
