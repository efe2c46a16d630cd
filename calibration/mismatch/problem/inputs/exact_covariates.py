"""Noisy inputs given covariates that have no error: what smoothing in time takes of an input that these show.

The error of a reading is independent of every other input. Where what smoothing took out of the readings follows a
column that is known exactly, that part is no error but the truth: a tension that goes up and down with the angle of a
crank, of which a model of time alone takes a share with each turn. It is put back, so that the expectation is one given
the exact covariates, too (regression calibration; Carroll et al., 2006, chapter 4). Else a prediction lacks a share
that follows the angle, as if physics were missing that depends on it.

An exact column may follow the error all the same: a controller acts on the reading, or it was computed from it. By the
truth more is taken out than a smoother takes of errors of the stated size, and by the error itself no more.

Of an input that changes much from reading to reading, smoothing leaves most of the error, and exact columns together
may say more of it than the readings beside it: the head of a compressor is a function of its flow and speed. The
expectation is then that of a normal density about their joint regression (a polynomial of second degree), unless its
mean square error is larger (Stein's unbiased estimate). Else what the error does to the prediction follows these
columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.inputs.input_doubt import wheels_in_common
from regolithd.calibration.mismatch.problem.inputs.reading_scale import ReadingScale
from regolithd.calibration.mismatch.signal.chi_squared import quantile
from regolithd.calibration.mismatch.signal.hat_basis import KnotPlaces

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import ExpectedInputs
    from regolithd.calibration.mismatch.problem.inputs.true_values import Smoother
    from regolithd.calibration.mismatch.problem.prior import SensorError

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
"""Readings for each knot, or term of a polynomial, from which it is asked (a choice: the function has a tenth of the
error then)."""
WORSE = 1.1
"""Factor by which the mean square error given all columns may be larger (a choice: a model of time alone may be finer,
and its error follows these columns all the same)."""
BESIDE = (-4, -3, -2, -1, 1, 2, 3, 4)
"""Readings beside each one that predict it too (a choice: an input that changes much is not told by further ones)."""
MOST_TAKEN = 0.8
"""Share of an error's variance up to which a joint regression is asked (a choice: where it would take all of it, an
error that is stated too large leaves the regression alone)."""


@dataclass(frozen=True, eq=False)
class _Exact:
    """A column without an error, of one wheel or of all, and where between the knots of a function of it each value is.

    Attributes
    ----------
    values, known: what was measured, and where, shape (time,)
    between: as it is
    """

    values: Array
    known: NDArray[np.bool_]
    between: KnotPlaces

    @classmethod
    def of(cls, values: Array) -> _Exact | None:
        """Return it for values (time,), None where these hardly vary."""
        known = np.isfinite(values)
        between = KnotPlaces.of(values, known, KNOTS)
        return None if between is None else cls(values, known, between)

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
    drawn = cache(lambda: _Drawn.of(read, deviation, smoother))
    found, left = smooth, list(others)
    while left:
        taken_out = np.where(uncertain, (read - found) / of_error, 0.0)
        functions = [other.followed_by(taken_out, uncertain) for other in left]
        best = int(np.argmax([gain for gain, _ in functions]))
        if not functions[best][0]:
            break
        found = found + np.where(uncertain, functions[best][1] * deviation, 0.0)
        del left[best]
    if found is not smooth:
        before, after = (float(np.mean(((read - each) / of_error)[uncertain] ** 2)) for each in (smooth, found))
        of_truth = before - drawn().taken_out(uncertain)
        found = smooth if of_truth < LEAST_OF_TRUTH * (before - after) else found
    jointly = _given_jointly(read, found, of_error, drawn, others, uncertain)
    found = found if jointly is None else jointly
    return np.where(np.sign(found) == np.sign(smooth), found, smooth)


def _given_jointly(
    read: Array,
    alone: Array,
    deviation: Array,
    drawn: Callable[[], _Drawn],
    others: Sequence[_Exact],
    uncertain: NDArray[np.bool_],
) -> Array | None:
    """Return the expectation (time,) given the readings and all exact columns together; None: `alone` is as good.

    About a polynomial of second degree in the columns, and the readings beside, the truth is normal. It is asked where
    what `alone` takes out of the readings follows that polynomial, by the truth and not by the error.
    """
    rows = np.all([uncertain, *(other.known for other in others)], axis=0)
    if not others or rows.sum() < READINGS_A_KNOT * (1 + len(others)) * (2 + len(others)) / 2:
        return None
    terms = _terms([other.values[rows] for other in others])
    taken_out = ((read - alone) / deviation)[rows]
    power = float(np.mean(taken_out**2))
    explained = float(np.mean(_fitted(terms, taken_out) * taken_out))
    gain = explained / max(power - explained, 1e-300) * (rows.sum() - len(terms))
    if gain <= quantile(len(terms), LEVEL) or power - drawn().taken_out(rows) < LEAST_OF_TRUTH * explained:
        return None
    error = deviation[rows] ** 2
    left = read[rows] - _fitted([*terms, *_beside(read)[:, rows]], read[rows])
    of_the_truth = max(float(np.sum(left**2)) / (rows.sum() - len(terms) - len(BESIDE)) - float(np.mean(error)), 0.0)
    taken = error / (of_the_truth + error)
    least = power - 1 + 2 * drawn().mean_kept(rows)
    if float(np.mean(taken)) > MOST_TAKEN or 1 - float(np.mean(taken)) > WORSE * least:
        return None
    found = alone.copy()
    found[rows] = read[rows] - taken * left
    return found


def _fitted(terms: Sequence[Array], values: Array) -> Array:
    """Return the least-squares fit of values by terms, each of shape (reading,)."""
    design = np.stack(terms, axis=1)
    return np.asarray(design @ np.linalg.lstsq(design, values, rcond=SINGULAR)[0])


def _terms(columns: Sequence[Array]) -> list[Array]:
    """Return a constant, the columns in standard deviations about their means, and their products by pairs."""
    scaled = [(each - each.mean()) / (float(each.std()) or 1.0) for each in columns]
    return [np.ones(len(scaled[0])), *scaled, *(a * b for a, b in combinations_with_replacement(scaled, 2))]


def _beside(read: Array) -> Array:
    """Return the readings before and after each (time,), on straight lines across blanks, shape (neighbour, time)."""
    at, known = np.arange(len(read)), np.isfinite(read)
    filled = np.interp(at, at[known], read[known])
    return np.stack([filled[np.clip(at + lag, 0, len(read) - 1)] for lag in BESIDE])


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Errors of the readings that were drawn, and what a smoother keeps of them, shape (time,) in their deviations."""

    errors: Array
    kept: Array

    @classmethod
    def of(cls, read: Array, deviation: Array, smoother: Smoother) -> _Drawn:
        """Draw errors with this deviation, shape (time,), and smooth the readings (time,) with them."""
        errors = np.random.default_rng(0).normal(size=len(read))
        kept = smoother(read + deviation * errors) - smoother(read)
        return cls(errors, kept / np.where(deviation > 0, deviation, 1.0))

    def mean_kept(self, where: NDArray[np.bool_]) -> float:
        """Return the mean share of an error that the smoother keeps in the estimate of its own reading."""
        return float(np.mean((self.errors * self.kept)[where]))

    def taken_out(self, where: NDArray[np.bool_]) -> float:
        """Return what the smoother takes of the errors, as a share of their mean square."""
        return float(np.mean((self.errors[where] - self.kept[where]) ** 2))
