"""Noisy inputs given covariates that have no error: what smoothing in time takes of an input that these show.

The error of a reading is independent of every other input. Where what smoothing took out of the readings follows a
column that is known exactly, that part is no error but the truth: a tension that goes up and down with the angle of a
crank, of which a model of time alone takes a share with each turn. It is put back, so that the expectation is one given
the exact covariates, too (regression calibration; Carroll et al., 2006, chapter 4). Else a prediction lacks a share
that follows the angle, as if physics were missing that depends on it.

An exact column may follow the error all the same: a controller acts on the reading, or it was computed from it. By the
truth more is taken out than a smoother takes of errors of the stated size, and by the error itself no more.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.input_doubt import wheels_in_common
from regolithd.calibration.mismatch.problem.reading_scale import ReadingScale
from regolithd.calibration.mismatch.signal.chi_squared import quantile
from regolithd.calibration.mismatch.signal.hat_basis import KnotPlaces

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.errors_in_variables import ExpectedInputs
    from regolithd.calibration.mismatch.problem.prior import SensorError
    from regolithd.calibration.mismatch.problem.true_values import Smoother

Array = NDArray[np.float64]

KNOTS = 24
"""Knots of the function of an exact input (a choice: of an angle six harmonics)."""
LEVEL = 1e-4
"""Probability by chance from which something follows an exact input (a choice: of a hundred pairs of columns none)."""
SINGULAR = 1e-9
"""Relative singular value below which a knot has no readings: rounding."""
LEAST_OF_TRUTH = 1 / 2
"""What was taken out beyond errors of the stated size, as a share of what follows exact inputs (a choice: half way
between that of errors, which is none, and that of the truth, which is all; 1.3 to 4 in five recordings of a loom)."""
READINGS_A_KNOT = 10
"""Readings for each knot from which it is asked (a choice: the function has a tenth of the error then)."""


@dataclass(frozen=True, eq=False)
class _Exact:
    """A column without an error, of one wheel or of all, and where between the knots of a function of it each value is.

    Attributes
    ----------
    known: where it was measured, shape (time,)
    between: as it is
    """

    known: NDArray[np.bool_]
    between: KnotPlaces

    @classmethod
    def of(cls, values: Array) -> _Exact | None:
        """Return it for values (time,), None where these hardly vary."""
        known = np.isfinite(values)
        between = KnotPlaces.of(values, known, KNOTS)
        return None if between is None else cls(known, between)

    def followed_by(self, values: Array, uncertain: NDArray[np.bool_]) -> tuple[float, Array]:
        """Return by how much more than chance values (time,) follow this, in Δχ², and the function of it (time,)."""
        rows, count = uncertain & self.known, self.between.knots
        nothing = 0.0, np.zeros(len(values))
        if rows.sum() < READINGS_A_KNOT * count:
            return nothing
        at, right, there = self.between.left[rows], self.between.right_share[rows], values[rows]
        left = 1 - right

        def sums(weights: Array, knot: int) -> Array:
            return np.asarray(np.bincount(at + knot, weights, count), np.float64)

        moment = sums(left * there, 0) + sums(right * there, 1)
        products = np.diag(sums(left**2, 0) + sums(right**2, 1))
        beside = sums(left * right, 0)[:-1]
        products += np.diag(beside, 1) + np.diag(beside, -1)
        coefficients = np.linalg.lstsq(products, moment, rcond=SINGULAR)[0]
        explained, power = float(coefficients @ moment), float(there @ there)
        gain = explained / max(power - explained, 1e-300) * (len(there) - count)
        by_chance = quantile(count, LEVEL)
        if gain <= by_chance:
            return nothing
        function = coefficients[self.between.left] * (1 - self.between.right_share)
        function += coefficients[self.between.left + 1] * self.between.right_share
        return gain - by_chance, np.where(self.known, function, 0.0)


def given_exact_covariates(
    as_read: Recording, made: ExpectedInputs, errors: Mapping[str, SensorError], exact: Sequence[str]
) -> Recording:
    """Return the smoothed inputs of a recording with what smoothing took of them that exact columns show.

    Parameters
    ----------
    as_read: the recording before
    made: with the inputs that have these `errors` smoothed, and how
    exact: names of columns without an error
    """

    @cache
    def exact_columns(wheel: int | None) -> list[_Exact]:
        """Return those of one wheel; None: those that all wheels share."""
        others = (as_read.channels[name] for name in exact)
        kept = (values for values in others if wheel is not None or wheels_in_common(values) > 1)
        return [each for values in kept if (each := _Exact.of(values[:, wheel or 0]))]

    completed = {}
    for name, smoothers in made.smoothers.items():
        read, smooth = as_read.channels[name], made.recording.channels[name]
        if wheels_in_common(read) > 1:
            column = _completed(read[:, 0], smooth[:, 0], errors[name], smoothers[0], exact_columns(None))
            completed[name] = np.repeat(column[:, None], read.shape[1], axis=1)
            continue
        columns = [
            _completed(read[:, wheel], smooth[:, wheel], errors[name], smoother, exact_columns(wheel))
            for wheel, smoother in enumerate(smoothers)
        ]
        completed[name] = np.stack(columns, axis=1)
    return made.recording.with_channels(**completed)


def _completed(read: Array, smooth: Array, error: SensorError, smoother: Smoother, others: Sequence[_Exact]) -> Array:
    """Return a smoothed column (time,) with what the readings less it follow of exact columns, the clearest first.

    An estimate of exactly 0 stays 0, and none changes its sign.
    """
    deviation = ReadingScale.of(read, error).error(smooth)
    uncertain = np.isfinite(read) & np.isfinite(smooth) & (smooth != 0) & (deviation > 0)
    of_error = np.where(uncertain, deviation, 1.0)
    found, left = smooth, list(others)
    while left:
        taken_out = np.where(uncertain, (read - found) / of_error, 0.0)
        functions = [other.followed_by(taken_out, uncertain) for other in left]
        best = int(np.argmax([gain for gain, _ in functions]))
        if not functions[best][0]:
            break
        found = found + np.where(uncertain, functions[best][1] * deviation, 0.0)
        del left[best]
    if found is smooth:
        return smooth
    before, after = (float(np.mean(((read - each) / of_error)[uncertain] ** 2)) for each in (smooth, found))
    of_truth = before - _taken_of_errors(read, deviation, smoother, uncertain)
    if of_truth < LEAST_OF_TRUTH * (before - after):
        return smooth
    return np.where(np.sign(found) == np.sign(smooth), found, smooth)


def _taken_of_errors(read: Array, deviation: Array, smoother: Smoother, uncertain: NDArray[np.bool_]) -> float:
    """Return what a smoother takes of errors of the readings (time,), as a share of their mean square."""
    drawn = np.random.default_rng(0).normal(size=len(read))
    kept = smoother(read + deviation * drawn) - smoother(read)
    return float(np.mean((drawn[uncertain] - (kept[uncertain] / deviation[uncertain])) ** 2))
