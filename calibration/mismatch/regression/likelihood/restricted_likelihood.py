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
from functools import cached_property
from math import log
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.screening.schur import pseudo_inverse, schur_complement
from regolithd.calibration.mismatch.signal.noise_models.noise_spectrum import (
    Bands,
    cosine_transform,
    likeliest_powers,
    minus_two_log_likelihood,
    spectra_of,
)
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


class GivenColumns:
    """What is fitted anyway to courses whose noise has a spectrum of its own in each, and the likeliest spectra beside.

    Courses that are too short to have a spectrum, or that are 0, are left out.

    Parameters
    ----------
    courses: readings that followed each other, each of shape (reading,)
    columns: what is fitted to each by generalised least squares, with the same coefficients, shape (column, reading)
    priors: of the coefficients of the first columns
    """

    def __init__(
        self,
        courses: Sequence[Array],
        columns: Sequence[Array],
        priors: Priors = NO_PRIORS,
        thresholds: Thresholds = THRESHOLDS,
    ) -> None:
        self._known = [k for k, each in enumerate(courses) if len(each) >= FEWEST_READINGS and each.any()]
        self.count = len(columns[0]) if columns else 0
        self._priors = priors
        self._transformed = [cosine_transform(np.vstack([columns[k], courses[k]])) for k in self._known]
        usual = [Bands.of(len(courses[k]), thresholds) for k in self._known]
        slower = [each.with_slowest(thresholds.slowest_possible_noise_share) for each in usual]
        self._bands = usual, slower
        self._before = tuple(
            likelihood.fitted(self.count, likelihood.courses.spectra(np.zeros(0), np.zeros((0, 0))))
            for likelihood in self._likelihoods(self._transformed, self.count)
        )

    def with_further(self, columns: Sequence[Array]) -> FurtherColumns:
        """Return what further columns gain, of each course as the given ones are."""
        total = self.count + (len(columns[0]) if columns else 0)
        series = [
            np.vstack([of_given[:-1], cosine_transform(columns[k]), of_given[-1:]])
            for k, of_given in zip(self._known, self._transformed, strict=True)
        ]
        usual, slow = (
            _InNoise(likelihood, self.count, before)
            for likelihood, before in zip(self._likelihoods(series, total), self._before, strict=True)
        )
        return FurtherColumns(usual, slow)

    def _likelihoods(self, transformed: Sequence[Array], count: int) -> tuple[_Likelihood, ...]:
        """Return the likelihood of so many columns in noise that is as slow as usually, and in slower noise."""
        held, mean = np.zeros((2, count))
        held[: len(self._priors.mean)], mean[: len(self._priors.mean)] = self._priors.precision, self._priors.mean
        products = _Products.of(self._bands[0], transformed, count)
        return tuple(_Likelihood(_Courses.of(bands, products), np.diag(held), mean) for bands in self._bands)


@dataclass(frozen=True, eq=False)
class FurtherColumns:
    """What columns gain beside given ones, in noise that is as slow as usually, and in slower noise."""

    _usual: _InNoise
    _slow: _InNoise

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


@dataclass(frozen=True, eq=False)
class _InNoise:
    """The fits to courses in noise up to some correlation time.

    Attributes
    ----------
    likelihood: of all columns
    given: how many of the first are given
    before: the fit of these
    """

    likelihood: _Likelihood
    given: int
    before: _Fitted

    def gain(self) -> float:
        """Return what the further columns gain."""
        return self._gain(self.likelihood)

    def smooth(self, roughness: Array) -> tuple[float, int]:
        """Return what they gain if they are smooth, and how many numbers are free."""
        if not len(self.likelihood.courses.shapes):
            return 0.0, 0
        given, count = self.given, len(roughness)
        matrix, moment, _ = self.likelihood.sums(given + count, self.before.spectra)
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
        smooth = self.likelihood.precision + times * prior * np.outer(back, back)
        gain = self._gain(replace(self.likelihood, precision=smooth)) - price
        return gain, int(seen.sum() - rough.sum()) + 1

    def _gain(self, likelihood: _Likelihood) -> float:
        before = self.before
        after = likelihood.fitted(len(likelihood.mean), before.spectra)
        return (before.restricted - before.at_the_end) - (after.restricted - after.at_the_start)


@dataclass(frozen=True, eq=False)
class _Spectra:
    """The spectrum of the noise in each course: powers, shape (course, process), and levels, shape (course, band)."""

    powers: Array
    level: Array


@dataclass(frozen=True, eq=False)
class _Products:
    """Products of the transforms of columns and readings in each course; a course may lack the last bands of another.

    Attributes
    ----------
    counts: coefficients in each band, shape (course, band)
    sums: of the columns, and of the readings as the last series, shape (course, band, series, series)
    """

    counts: Array
    sums: Array

    @classmethod
    def of(cls, bands: Sequence[Bands], transformed: Sequence[Array], columns: int) -> _Products:
        """Return the products of so many columns and of the readings in the bands of each course."""
        most = max((len(each.count) for each in bands), default=1)
        counts, sums = np.zeros((len(bands), most)), np.zeros((len(bands), most, columns + 1, columns + 1))
        for place, (each, series) in enumerate(zip(bands, transformed, strict=True)):
            own = len(each.count)
            counts[place, :own], sums[place, :own] = each.count, each.products(series)
        return cls(counts, sums)

    @property
    def of_readings(self) -> Array:
        """Return the readings' sums of squares, shape (course, band)."""
        return np.asarray(self.sums[..., -1, -1])

    def of_first(self, count: int) -> tuple[Array, Array]:
        """Return those of the first columns with each other, shape (course, band, …), and with the readings."""
        if count not in self._first:
            solved = self.sums[..., :count, :count].reshape(*self.counts.shape, count * count)
            self._first[count] = solved, np.ascontiguousarray(self.sums[..., :count, -1])
        return self._first[count]

    @cached_property
    def _first(self) -> dict[int, tuple[Array, Array]]:
        return {}


@dataclass(frozen=True, eq=False)
class _Courses:
    """Courses, each of readings that followed each other, in noise up to some correlation time.

    Attributes
    ----------
    shapes: spectrum of each process of variance 1, shape (course, process, band); 0 for one that a course lacks
    products: of the columns and of the readings
    """

    shapes: Array
    products: _Products

    @classmethod
    def of(cls, bands: Sequence[Bands], products: _Products) -> _Courses:
        """Return the courses with the processes of these bands."""
        processes = max((len(each.times) for each in bands), default=1)
        shapes = np.zeros((len(bands), processes, products.counts.shape[1]))
        for of_course, each in zip(shapes, bands, strict=True):
            of_course[: len(each.times), : len(each.count)] = each.shapes
            of_course[:, len(each.count) :] = 1.0  # in bands without a coefficient the level does not matter
        return cls(shapes, products)

    def spectra(self, coefficients: Array, covariance: Array, start: _Spectra | None = None) -> _Spectra:
        """Return the spectra of what a fit of the first columns leaves, found from `start` on.

        The fit takes degrees of freedom of each band: its uncertainty there over the spectrum that it was made with.
        """
        solved, moment = self.products.of_first(len(coefficients))
        left = self.products.of_readings - 2 * moment @ coefficients
        left += solved @ np.outer(coefficients, coefficients).ravel()
        taken = 0.0 if start is None else solved @ covariance.ravel() / start.level
        free, begin = np.maximum(self.products.counts - taken, 0.0), None if start is None else start.powers
        powers = likeliest_powers(self.shapes, np.maximum(left, 0.0), free, begin)
        return _Spectra(powers, spectra_of(self.shapes, powers))

    def weighted(self, spectra: _Spectra, count: int) -> tuple[Array, Array, float]:
        """Return matrix and moment of the first columns' normal equations, and −2 ln of the likelihood without them."""
        solved, moment = self.products.of_first(count)
        weights = 1 / spectra.level
        rest = minus_two_log_likelihood(spectra.level, self.products.of_readings, self.products.counts)
        matrix = np.asarray(np.tensordot(weights, solved, axes=2)).reshape(count, count)
        return matrix, np.asarray(np.tensordot(weights, moment, axes=2)), float(rest.sum())


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
    spectra: _Spectra


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """The restricted likelihood of fits to courses.

    Attributes
    ----------
    courses: readings and columns
    precision: of the prior of the columns' coefficients, shape (column, column), 0 where it has none
    mean: of each
    """

    courses: _Courses
    precision: Array
    mean: Array

    def fitted(self, count: int, spectra: _Spectra) -> _Fitted:
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
            spectra = self.courses.spectra(coefficients, covariance, spectra)
        assert best is not None  # noqa: S101  # the first fit is always one
        return best

    def sums(self, count: int, spectra: _Spectra) -> tuple[Array, Array, float]:
        """Return matrix and moment of the first columns' normal equations, and −2 ln of the likelihood without them."""
        precision, mean = self.precision[:count, :count], self.mean[:count]
        matrix, moment, rest = self.courses.weighted(spectra, count)
        held = precision @ mean
        return matrix + precision, moment + held, rest + float(mean @ held)


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
