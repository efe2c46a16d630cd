"""What columns gain in likelihood where the noise may have any spectrum: the restricted likelihood.

A curve of many coefficients that follows slow noise leaves nothing of it. With a spectrum that is fitted to what the
curve leaves, the readings then are far likelier, whether the curve is there or not: each coefficient that is fitted
takes a degree of freedom from the noise. The restricted likelihood (Patterson and Thompson, 1971; Harville, 1977)
counts them: to the power that is left in a band of frequencies the uncertainty of what was fitted is added, and a
spectrum that is lower by the coefficients alone gains nothing. By chance columns then gain as much as there are of
them, however slow the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.noise_spectrum import Bands, NoiseSpectrum
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]

CONVERGED = 0.05
"""By how much −2 ln of the likelihood falls at most when the columns are fitted with the newest spectrum, at its end (a
choice: what is told has to gain more than a hundred times as much)."""
MOST_FITS = 20
"""Times that columns are fitted at most (a choice: three to six are usual)."""
LEAST_EIGENVALUE = 1e-9
"""Share of the largest eigenvalue below which a combination of columns is rounding."""
FEWEST_READINGS = 64
"""Readings below which a course has no spectrum (a choice)."""


@dataclass(frozen=True)
class Priors:
    """What is known of the first columns' coefficients before the readings.

    Attributes
    ----------
    precision: one over the variance of each, shape (column,)
    mean: of each
    """

    precision: Array
    mean: Array


NO_PRIORS = Priors(np.zeros(0), np.zeros(0))


def gain_of_columns(
    courses: Sequence[Array],
    columns: Sequence[Array],
    given: int = 0,
    priors: Priors = NO_PRIORS,
    thresholds: Thresholds = THRESHOLDS,
) -> float:
    """Return what columns gain in twice the restricted log likelihood, with a spectrum of its own in each course.

    Courses that are too short to have a spectrum, or that are 0, are left out.

    Parameters
    ----------
    courses: readings that followed each other, each of shape (reading,)
    columns: what is fitted to each by generalised least squares, with the same coefficients, shape (column, reading)
    given: how many of the first columns are fitted anyway, and gain nothing
    priors: of the coefficients of the first columns
    """
    series = [np.vstack([of_course, values]) for values, of_course in zip(courses, columns, strict=True)]
    of_courses = [
        _Course.of(each, thresholds) for each in series if each.shape[1] >= FEWEST_READINGS and each[-1].any()
    ]
    if not of_courses:
        return 0.0
    held, mean = np.zeros((2, len(series[0]) - 1))
    held[: len(priors.mean)], mean[: len(priors.mean)] = priors.precision, priors.mean
    likelihood = _Likelihood(of_courses, held, mean)
    spectra = [course.spectrum(np.zeros(0), np.zeros((0, 0))) for course in of_courses]
    before = likelihood.fitted(given, spectra)
    after = likelihood.fitted(len(held), before.spectra)
    return (before.restricted - before.at_the_end) - (after.restricted - after.at_the_start)


@dataclass(frozen=True, eq=False)
class _Course:
    """Readings that followed each other, as products of the transforms of columns and readings.

    Attributes
    ----------
    bands: of frequency
    products: of the columns, and of the readings as the last series, shape (band, series, series)
    """

    bands: Bands
    products: Array

    @classmethod
    def of(cls, series: Array, thresholds: Thresholds) -> _Course:
        bands = Bands.of(series.shape[1], thresholds)
        return cls(bands, bands.products(series))

    def spectrum(self, coefficients: Array, covariance: Array) -> NoiseSpectrum:
        """Return the spectrum of what a fit of the first columns leaves, to which its uncertainty is added."""
        count = len(coefficients)
        solved, moment = self.products[:, :count, :count], self.products[:, :count, -1]
        left = self.products[:, -1, -1] - 2 * moment @ coefficients
        left += np.einsum("bij,ij->b", solved, np.outer(coefficients, coefficients) + covariance)
        return self.bands.fitted(np.maximum(left, 0.0))

    def weighted(self, spectrum: NoiseSpectrum, count: int) -> tuple[Array, Array, float]:
        """Return matrix and moment of the first columns' normal equations, and the readings' sum of squares."""
        sums = np.asarray(np.tensordot(1 / spectrum.level, self.products, axes=1), np.float64)
        return sums[:count, :count], sums[:count, -1], float(sums[-1, -1])


@dataclass(frozen=True, eq=False)
class _Fitted:
    """The likeliest spectra beside a fit.

    Attributes
    ----------
    restricted: −2 ln of the restricted likelihood
    at_the_start, at_the_end: logarithm of the determinant of the normal equations with the spectra that the fit began
        with, and with these. A prior as wide as what the readings know of the coefficients at the start stands for the
        constant that the restricted likelihood of other columns lacks.
    spectra: of the courses
    """

    restricted: float
    at_the_start: float
    at_the_end: float
    spectra: Sequence[NoiseSpectrum]


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """The restricted likelihood of fits to courses.

    Attributes
    ----------
    courses: readings and columns
    precision, mean: of the prior of each column's coefficient, 0 where it has none
    """

    courses: Sequence[_Course]
    precision: Array
    mean: Array

    def fitted(self, count: int, spectra: Sequence[NoiseSpectrum]) -> _Fitted:
        """Return the fit of the first columns at its likeliest spectra, found from these on."""
        kept = _independent(self._sums(count, spectra)[0])
        start, best = None, None
        for _ in range(MOST_FITS):
            matrix, moment, minus_two_log = self._sums(count, spectra)
            inside = kept.T @ matrix @ kept
            covariance = kept @ np.linalg.inv(inside) @ kept.T
            coefficients, determinant = covariance @ moment, float(np.linalg.slogdet(inside)[1])
            start = determinant if start is None else start
            value = minus_two_log - float(moment @ coefficients) + determinant
            if best is not None and value > best.restricted - CONVERGED:
                break
            best = _Fitted(value, start, determinant, spectra)
            spectra = [course.spectrum(coefficients, covariance) for course in self.courses]
        assert best is not None  # noqa: S101  # the first fit is always one
        return best

    def _sums(self, count: int, spectra: Sequence[NoiseSpectrum]) -> tuple[Array, Array, float]:
        """Return matrix and moment of the first columns' normal equations, and −2 ln of the likelihood without them."""
        held, mean = self.precision[:count], self.mean[:count]
        matrix, moment, rest = np.diag(held), held * mean, float(held @ mean**2)
        for course, spectrum in zip(self.courses, spectra, strict=True):
            of_course = course.weighted(spectrum, count)
            matrix, moment = matrix + of_course[0], moment + of_course[1]
            rest += of_course[2] + spectrum.log_determinant
        return matrix, moment, rest


def _independent(matrix: Array) -> Array:
    """Return the combinations of columns that differ by more than rounding, shape (column, combination)."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(np.float64).tiny))
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors[:, values > LEAST_EIGENVALUE * max(values.max(initial=0.0), 0.0)])
