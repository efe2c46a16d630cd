"""What columns gain in likelihood where the noise may have any spectrum: the restricted likelihood.

A curve of many coefficients that follows slow noise leaves nothing of it. With a spectrum that is fitted to what the
curve leaves, the readings then are far likelier, whether the curve is there or not: each coefficient that is fitted
takes a degree of freedom from the noise. The restricted likelihood (REML: Patterson and Thompson, 1971; Harville, 1977)
counts them: the power that is left in a band of frequencies has fewer degrees of freedom by those that the fit takes
there, and a spectrum that is lower by the coefficients alone gains nothing. By chance columns then gain as much as
there are of them, however slow the noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.schur import pseudo_inverse, schur_complement
from regolithd.calibration.mismatch.signal.noise_spectrum import Bands, NoiseSpectrum
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Array = NDArray[np.float64]

CONVERGED = 0.05
"""By how much −2 ln of the likelihood falls at most when the columns are fitted with the newest spectrum, at its end (a
choice: what is told has to gain more than a hundred times as much)."""
MOST_FITS = 20
"""Times that columns are fitted at most (a choice: three to six are usual)."""
SLOW_NOISE_PENALTY = 4.6
"""What noise costs in −2 ln of the likelihood that is slower than it usually is: odds of one in ten, 2 ln 10 (a
choice)."""
LEAST_EIGENVALUE = 1e-9
"""Share of the largest eigenvalue below which a combination of columns is rounding."""
SMOOTHNESS = tuple(4.0**power for power in range(-6, 13))
"""Multiples of the roughness that are tried, in those that weigh as much as the readings (a choice: between two of
them the likelihood changes by a tenth)."""
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


class FurtherColumns:
    """What columns gain beside others in noise that has a spectrum of its own in each course.

    Courses that are too short to have a spectrum, or that are 0, are left out.

    Parameters
    ----------
    courses: readings that followed each other, each of shape (reading,)
    columns: what is fitted to each by generalised least squares, with the same coefficients, shape (column, reading)
    given: how many of the first columns are fitted anyway, and gain nothing
    priors: of the coefficients of the first columns
    """

    def __init__(
        self,
        courses: Sequence[Array],
        columns: Sequence[Array],
        given: int = 0,
        priors: Priors = NO_PRIORS,
        thresholds: Thresholds = THRESHOLDS,
    ) -> None:
        series = [np.vstack([of_course, values]) for values, of_course in zip(courses, columns, strict=True)]
        known = [each for each in series if each.shape[1] >= FEWEST_READINGS and each[-1].any()]
        count = len(series[0]) - 1 if series else 0
        held, mean = np.zeros((2, count))
        held[: len(priors.mean)], mean[: len(priors.mean)] = priors.precision, priors.mean
        courses_of = [_Course.of(each, thresholds) for each in known]
        self._usual = _InNoise(_Likelihood(courses_of, np.diag(held), mean), given)
        share = thresholds.slowest_possible_noise_share
        slower = [replace(each, bands=each.bands.with_slowest(share)) for each in courses_of]
        self._slow = _InNoise(_Likelihood(slower, np.diag(held), mean), given)

    def gain(self) -> float:
        """Return by how much twice the restricted log likelihood rises, whatever the coefficients."""
        return self._in_either(self._usual.gain(), self._slow.gain)

    def gain_if_smooth(self, roughness: Array) -> tuple[float, int]:
        """Return the same where the coefficients are as smooth as is likeliest, and how many numbers that leaves free.

        Their prior is normal, with a multiple of `roughness` (column, column) as its precision (Wahba, 1978): what has
        none is free, and the multiple is.
        """
        gain, free = self._usual.smooth(roughness)
        return self._in_either(gain, lambda: self._slow.smooth(roughness)[0]), free

    def _in_either(self, gain: float, gain_in_slow: Callable[[], float]) -> float:
        """Return the gain where the noise is as slow as it usually is, or slower, whichever is likelier with each."""
        usual, slow = self._usual.before.restricted, self._slow.before.restricted + SLOW_NOISE_PENALTY
        if slow >= usual:  # then it is likelier with the columns, too: slower noise explains a part of what they do
            return gain
        return slow - min(usual - gain, slow - gain_in_slow())


class _InNoise:
    """The fits to courses in noise up to some correlation time.

    Attributes
    ----------
    before: the fit of the columns that are given
    """

    def __init__(self, likelihood: _Likelihood, given: int) -> None:
        self._likelihood, self._given = likelihood, given
        spectra = [course.spectrum(np.zeros(0), np.zeros((0, 0))) for course in likelihood.courses]
        self.before = likelihood.fitted(given, spectra)

    def gain(self) -> float:
        """Return what the further columns gain."""
        return self._gain(self._likelihood)

    def smooth(self, roughness: Array) -> tuple[float, int]:
        """Return what they gain if they are smooth, and how many numbers are free."""
        if not self._likelihood.courses:
            return 0.0, 0
        given, count = self._given, len(roughness)
        matrix, moment, _ = self._likelihood.sums(given + count, self.before.spectra)
        scale = _scale(matrix)
        matrix, moment = matrix * np.outer(scale, scale), moment * scale
        seen = scale[given:] > 0
        values, vectors = np.linalg.eigh(_of_seen(roughness, seen) * np.outer(scale[given:], scale[given:]))
        rough = values > LEAST_EIGENVALUE * values[-1]
        if not rough.any():
            return self.gain(), int(seen.sum())
        prior = np.zeros(matrix.shape)
        prior[given:, given:] = (vectors[:, rough] * values[rough]) @ vectors[:, rough].T
        free = np.zeros((given + count, given + count - int(rough.sum())))
        free[:given, :given], free[given:, given:] = np.eye(given), vectors[:, ~rough]
        # What the prior's width costs, with the spectra of what the given columns leave, but for the multiple of it.
        width = _explained(free.T @ matrix @ free, free.T @ moment)[1] + float(np.sum(np.log(values[rough])))
        tried = []
        for factor in SMOOTHNESS:
            times = float(factor * seen.sum() / np.sum(values[rough]))
            explained, determinant = _explained(matrix + times * prior, moment)
            price = determinant - width - float(rough.sum()) * log(times)
            tried.append((explained - price, times, price))
        _, times, price = max(tried)
        back = np.divide(1.0, scale, out=np.zeros(len(scale)), where=scale > 0)
        smooth = self._likelihood.precision + times * prior * np.outer(back, back)
        gain = self._gain(replace(self._likelihood, precision=smooth)) - price
        return gain, int(seen.sum() - rough.sum()) + 1

    def _gain(self, likelihood: _Likelihood) -> float:
        before = self.before
        after = likelihood.fitted(len(likelihood.mean), before.spectra)
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

    def spectrum(self, coefficients: Array, covariance: Array, start: NoiseSpectrum | None = None) -> NoiseSpectrum:
        """Return the spectrum of what a fit of the first columns leaves, found from `start` on.

        The fit takes degrees of freedom of each band: its uncertainty there over the spectrum that it was made with.
        """
        count = len(coefficients)
        solved, moment = self.products[:, :count, :count], self.products[:, :count, -1]
        left = self.products[:, -1, -1] - 2 * moment @ coefficients
        left += np.einsum("bij,ij->b", solved, np.outer(coefficients, coefficients))
        taken = 0.0 if start is None else np.einsum("bij,ij->b", solved, covariance) / start.level
        return self.bands.fitted(np.maximum(left, 0.0), np.maximum(self.bands.count - taken, 0.0), start)

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
    precision: of the prior of the columns' coefficients, shape (column, column), 0 where it has none
    mean: of each
    """

    courses: Sequence[_Course]
    precision: Array
    mean: Array

    def fitted(self, count: int, spectra: Sequence[NoiseSpectrum]) -> _Fitted:
        """Return the fit of the first columns at its likeliest spectra, found from these on."""
        kept = _independent(self.sums(count, spectra)[0])
        start, best = None, None
        for _ in range(MOST_FITS):
            matrix, moment, minus_two_log = self.sums(count, spectra)
            inside = kept.T @ matrix @ kept
            covariance = kept @ np.linalg.inv(inside) @ kept.T
            coefficients, determinant = covariance @ moment, float(np.linalg.slogdet(inside)[1])
            start = determinant if start is None else start
            value = minus_two_log - float(moment @ coefficients) + determinant
            if best is not None and value > best.restricted - CONVERGED:
                break
            best = _Fitted(value, start, determinant, spectra)
            of_courses = zip(self.courses, spectra, strict=True)
            spectra = [course.spectrum(coefficients, covariance, spectrum) for course, spectrum in of_courses]
        assert best is not None  # noqa: S101  # the first fit is always one
        return best

    def sums(self, count: int, spectra: Sequence[NoiseSpectrum]) -> tuple[Array, Array, float]:
        """Return matrix and moment of the first columns' normal equations, and −2 ln of the likelihood without them."""
        matrix, mean = self.precision[:count, :count], self.mean[:count]
        moment = matrix @ mean
        rest = float(mean @ moment)
        for course, spectrum in zip(self.courses, spectra, strict=True):
            of_course = course.weighted(spectrum, count)
            matrix, moment = matrix + of_course[0], moment + of_course[1]
            rest += of_course[2] + spectrum.log_determinant
        return matrix, moment, rest


def _independent(matrix: Array) -> Array:
    """Return the combinations of columns that differ by more than rounding, shape (column, combination)."""
    scale = _scale(matrix)
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors[:, values > LEAST_EIGENVALUE * max(values.max(initial=0.0), 0.0)])


def _scale(matrix: Array) -> Array:
    """Return by what columns are multiplied to be of size 1, shape (column,); 0 for those that are 0 themselves."""
    size = np.diag(matrix)
    seen = size > LEAST_EIGENVALUE**2 * size.max(initial=0.0)
    return np.divide(1.0, np.sqrt(np.where(seen, size, 1.0)), out=np.zeros(len(size)), where=seen)


def _of_seen(precision: Array, seen: NDArray[np.bool_]) -> Array:
    """Return the precision of the coefficients of columns that are seen, whatever the others are; 0 for these."""
    found, own, others = np.zeros(precision.shape), np.ix_(seen, seen), np.ix_(~seen, ~seen)
    inverse = pseudo_inverse(precision[others], LEAST_EIGENVALUE)
    found[own] = schur_complement(precision[own], precision[np.ix_(~seen, seen)], inverse)
    return found


def _explained(matrix: Array, moment: Array) -> tuple[float, float]:
    """Return what normal equations explain, and the logarithm of their determinant, rounding left out of both."""
    values, vectors = np.linalg.eigh(matrix)
    kept = values > LEAST_EIGENVALUE * values.max(initial=0.0)
    along = vectors[:, kept].T @ moment
    return float(np.sum(along**2 / values[kept])), float(np.sum(np.log(values[kept])))
