"""Weighted normal equations of sets of terms beside the free parameters, on given folds.

The Δχ² of a set is what it takes from the weighted sum of squares beyond what the free parameters, held by their
priors, take alone. Weights are one over the long-run variance of the noise, so Δχ² is twice a log likelihood ratio.
The equations are immutable: other weights, further columns or another prior make new ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.group import Fit, Term
from regolithd.calibration.mismatch.regression.likelihood.lasting_errors import (
    covariance_of_scores,
    has_lasting_errors,
    moments_of_errors,
)
from regolithd.calibration.mismatch.regression.penalties import penalty
from regolithd.calibration.mismatch.regression.screening.asked import Asked
from regolithd.calibration.mismatch.regression.screening.batch import Left
from regolithd.calibration.mismatch.regression.screening.gains import Gains
from regolithd.calibration.mismatch.regression.screening.schur import pseudo_inverse, schur_complement

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix, Reliability
    from regolithd.calibration.mismatch.regression.group import Group
    from regolithd.calibration.mismatch.regression.nuisance import Nuisance
    from regolithd.calibration.mismatch.signal.noise_models.whitening import Whitening
    from regolithd.calibration.mismatch.thresholds import Thresholds

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Columns = tuple[tuple[int, tuple[int, ...]], ...]
Derived = TypeVar("Derived")

MOST_SOLVED = 512
"""Fits that are kept (a choice: they take about a MiB)."""
MOST_ASKED = 4
"""Lists of groups of which what was asked is kept (a choice: a search asks effects and smooth terms in turn)."""
SINGULAR = 1e-10
"""Relative eigenvalue below which a direction of the normal equations counts as undetermined: rounding of float32."""
BY_ERRORS = 4.0
"""Times what the inputs' errors give a term on average that it has to gain (a choice: they have few directions of much
power, and of one alone four times the mean is exceeded in one of twenty)."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Sums of products of columns, weighted, on some folds.

    Attributes
    ----------
    design: the columns
    nuisance: the free parameters and their priors
    weights: one over the long-run variance, shape (wheel,)
    folds: the folds whose instants are fitted
    """

    design: DesignMatrix
    nuisance: Nuisance
    weights: Array
    folds: tuple[int, ...]

    @property
    def problem(self) -> Problem:
        """What the columns were made from."""
        return self.design.problem

    @property
    def thresholds(self) -> Thresholds:
        """The numbers that decide."""
        return self.design.problem.thresholds

    @property
    def all_wheels(self) -> tuple[int, ...]:
        """Indices of all wheels."""
        return tuple(range(len(self.weights)))

    @property
    def wheel_sets(self) -> Mapping[tuple[int, ...], str]:
        """Wheels that may share an effect, and whether these are all, one alone, or some."""
        found: dict[tuple[int, ...], str] = {(w,): "one" for w in self.all_wheels}
        found[self.all_wheels] = "all"
        for some in self.problem.wheel_sets:
            found.setdefault(some, "some")
        return found

    def weighted(self, weights: Array) -> NormalEquations:
        """Return the equations with other weights of the wheels."""
        if np.array_equal(weights, self.weights):
            return self
        return normal_equations(self.design, self.nuisance, weights, self.folds)

    def whitened(self, whitening: Whitening, weights: Array, reliability: Reliability | None = None) -> NormalEquations:
        """Return the equations under another whitening, with the weights of the whitened wheels."""
        return normal_equations(self.design.whitened_by(whitening, reliability), self.nuisance, weights, self.folds)

    def over(self, design: DesignMatrix) -> NormalEquations:
        """Return the equations of a design matrix that this one was extended to."""
        return replace(self, design=design)

    @cached_property
    def moment(self) -> Array:
        """Weighted sums of products of all columns with the residual, shape (wheel, column)."""
        return self._weighted(self.design.moment)

    def products(self, rows: Sequence[int] | Index, columns: Sequence[int] | Index) -> Array:
        """Return weighted sums of products of some columns with others, shape (wheel, row, column)."""
        return self._weighted(self.design.products(rows, columns))

    def energies(self, columns: Sequence[int] | Index) -> Array:
        """Return weighted sums of squares of some columns, shape (wheel, column)."""
        return self._weighted(self.design.energies(columns))

    def _weighted(self, of_folds: NDArray[Any]) -> Array:
        """Return sums (fold, wheel, …) over the folds, weighted."""
        total = np.zeros(of_folds.shape[1:])
        for fold in self.folds:
            total += of_folds[fold]
        total *= self.weights.reshape(-1, *[1] * (total.ndim - 1))
        return total

    def with_groups(self, groups: Sequence[Group]) -> NormalEquations:
        """Return the equations with other groups to choose from."""
        return replace(self, design=self.design.with_groups(groups))

    def with_nuisance(self, nuisance: Nuisance) -> NormalEquations:
        """Return the equations with other priors of the free parameters."""
        return replace(self, nuisance=nuisance)

    def fit(self, terms: Iterable[Term]) -> Fit:
        """Fit terms and free parameters together."""
        terms = tuple(terms)
        columns = self.columns_of(terms)
        return Fit(terms, columns, *self._solved(columns))

    def _solved(self, columns: Columns) -> tuple[Array, Array, float]:
        """Return coefficients, covariance and Δχ² of these columns; the latest are kept: most are asked for again."""
        if columns not in self._latest_solved:
            if len(self._latest_solved) == MOST_SOLVED:
                del self._latest_solved[next(iter(self._latest_solved))]
            matrix, moment = self._normal(columns)
            inverse = pseudo_inverse(matrix, SINGULAR)
            solved = inverse @ moment
            explained = float(moment @ solved) - self._explained_by_parameters
            self._latest_solved[columns] = solved, inverse, explained
        return self._latest_solved[columns]

    @cached_property
    def _latest_solved(self) -> dict[Columns, tuple[Array, Array, float]]:
        return {}

    def lately(self, derive: Callable[[NormalEquations, Sequence[Term]], Derived], terms: Sequence[Term]) -> Derived:
        """Return what is derived from terms beside these equations; the latest is kept: much is tried beside the same.

        Terms are compared by identity.
        """
        key = derive, *map(id, terms)
        if key not in self._latest:
            self._latest.clear()
            self._latest[key] = tuple(terms), derive(self, terms)  # no other term gets the identity of one that is kept
        return self._latest[key][1]

    @cached_property
    def _latest(self) -> dict[tuple[Any, ...], tuple[tuple[Term, ...], Any]]:
        return {}

    def shifts_of_parameters(self, fit: Fit) -> Array:
        """Return how far a fit moves each free parameter, in its own unit, shape (parameter,)."""
        columns = list(self.nuisance.columns)
        return np.asarray(fit.coefficients[: len(columns)] / self.design.scale[columns])

    def normal_matrix(self, terms: Iterable[Term]) -> Array:
        """Return the matrix of the normal equations of terms, the priors included, shape (column, column)."""
        return self._normal(self.columns_of(tuple(terms)))[0]

    @cached_property
    def _explained_by_parameters(self) -> float:
        """Return the Δχ² of the free parameters alone, of which one may act on nothing and have no prior."""
        matrix, moment = self._normal(self.columns_of(()))
        return float(moment @ pseudo_inverse(matrix, SINGULAR) @ moment)

    def information(self, terms: Iterable[Term], kept: Sequence[int]) -> tuple[Array, Array]:
        """Return the information matrix and vector of some free parameters beside terms and all other parameters.

        They are of the readings alone, without these parameters' own priors; `kept` are their places. The vector has
        the covariance M + V, where errors of the inputs that last add V: what it knows is M (M + V)⁻¹ M.
        """
        columns = self.columns_of(tuple(terms))
        return information_of_some(
            *self._normal(columns), self.moments_of_errors(columns), self.nuisance, kept, SINGULAR
        )

    def moments_of_errors(self, columns: Columns) -> Array:
        """Return the moments of a fit's columns with draws of errors that last, shape (draw, column)."""
        if not has_lasting_errors(self.problem):
            return np.zeros((0, len(columns)))
        on = membership(columns, len(self.weights))[:, :, None]
        read = self.design.in_time(self.design.columns_as_read([column for column, _ in columns]) * on)
        return moments_of_errors(self.design, self.weights, self.design.whitened_in_time(read))

    def needed_beside_errors(self, given: Iterable[Term], term: Term) -> float:
        """Return the Δχ² that a term has to gain beside others beyond what inputs' errors that last give it.

        These give it what it gains in a fit to draws of them: right on average, however few the draws are. 0 where no
        errors last.
        """
        if not has_lasting_errors(self.problem):
            return 0.0
        columns = self.columns_of((*given, term))
        matrix, scores = self._normal(columns)[0], covariance_of_scores(self.moments_of_errors(columns))

        def explained(size: int) -> float:
            """Return the Δχ² of the first columns, on average over the draws."""
            return float(np.sum(pseudo_inverse(matrix[:size, :size], SINGULAR) * scores[:size, :size]))

        return BY_ERRORS * (explained(len(columns)) - explained(len(columns) - len(term.group.columns)))

    def penalty(self, term: Term) -> float:
        """Return what a term has to gain beyond chance, in Δχ²."""
        return penalty(term, len(self.weights), self.thresholds)

    def score(self, fit: Fit) -> float:
        """Return Δχ² less the penalties; a term at frequencies of little noise counts by so much more."""
        total = fit.delta_chi2
        for index, term in enumerate(fit.terms):
            if term.group.noise_reduction > 1:
                values = fit.coefficients[fit.of_term(index)]
                products = self.design.own_products(term.group.columns, self.folds)
                own = sum(float(values @ (products[w] * self.weights[w]) @ values) for w in term.wheels)
                total += (term.group.noise_reduction - 1) * own
        return total - sum(self.penalty(term) for term in fit.terms)

    def further(self, given: Iterable[Term], groups: Sequence[Group] | None = None) -> list[tuple[float, Term]]:
        """Return the further Δχ² of every group beside `given`, on each set of wheels that may share it."""
        return self.gains(given, self.design.groups if groups is None else groups).terms()

    def gains(self, given: Iterable[Term], groups: Sequence[Group]) -> Gains:
        """Return the same of these groups as a table."""
        asked, fitted = self._asked(tuple(groups)), self.fit(given)
        at, on = asked.at, np.array([[float(wheel in wheels) for wheel in self.all_wheels] for wheels in asked.sets])
        cross = np.tensordot(on, self._crosses(fitted.columns, asked), axes=1)
        moment = on @ self.moment[:, at] - fitted.coefficients @ cross
        left = Left(on, moment, cross, fitted.covariance @ cross, on @ self.energies(at))
        gains = np.zeros(asked.may_share.shape)
        for batch in asked.batches:
            of_sets, of_groups = np.nonzero(asked.may_share[:, batch.which])
            found = batch.gains(left, of_sets, of_groups, self.thresholds.least_tolerance)
            gains[of_sets, batch.which[of_groups]] = found
        counted = np.where(gains > 0, gains * asked.noise_reductions, 0.0)
        return Gains(asked.groups, asked.sets, counted, asked.penalties)

    def _asked(self, groups: tuple[Group, ...]) -> Asked:
        """Return what does not depend on what the groups are fitted beside; the latest are kept.

        Groups are compared by identity.
        """
        key = tuple(map(id, groups))
        if key not in self._latest_asked:
            if len(self._latest_asked) == MOST_ASKED:
                self._latest_asked.clear()
            # It keeps the groups, and so their identities.
            self._latest_asked[key] = Asked.of(self.design, self.weights, self.folds, self.wheel_sets, groups)
        return self._latest_asked[key]

    @cached_property
    def _latest_asked(self) -> dict[tuple[int, ...], Asked]:
        return {}

    def cross(self, fitted: Columns, at: Index, wheels: tuple[int, ...]) -> Array:
        """Return sums of products of fitted columns and others that act on `wheels`, shape (fitted, other)."""
        on = membership(fitted, len(self.weights)).T[:, :, None]
        return np.asarray((on * self.products([column for column, _ in fitted], at))[list(wheels)].sum(axis=0))

    def _crosses(self, fitted: Columns, asked: Asked) -> Array:
        """Return sums of products of fitted columns, where they act, and what is asked, shape (wheel, fitted, other).

        Most columns of a fit were in the one before.
        """
        fresh = list(dict.fromkeys(column for column, _ in fitted if column not in asked.crosses))
        if fresh:
            asked.crosses.update(zip(fresh, np.swapaxes(self.products(fresh, asked.at), 0, 1), strict=True))
        on = membership(fitted, len(self.weights)).T
        known = [asked.crosses[column] for column, _ in fitted]
        return on[:, :, None] * np.stack(known, axis=1) if known else np.zeros((*on.shape, len(asked.at)))

    def own_and_complement(self, given: Iterable[Term], term: Term) -> tuple[Array, Array]:
        """Return a term's sums of products, and their Schur complement beside `given` and the free parameters."""
        columns = self.columns_of((*given, term))
        size = len(columns) - len(term.group.columns)
        matrix, _ = self._normal(columns)
        inverse = pseudo_inverse(matrix[:size, :size], SINGULAR) if size else np.zeros((0, 0))
        own = matrix[size:, size:]
        return own, schur_complement(own, matrix[:size, size:], inverse)

    def tolerance(self, given: Iterable[Term], term: Term) -> float:
        """Return the share of a term's energy outside the span of all else in the fit: 1 / variance inflation."""
        own, complement = self.own_and_complement(given, term)
        return float(complement[0, 0] / max(float(own[0, 0]), 1e-300))

    def columns_of(self, terms: Iterable[Term]) -> Columns:
        """Return the columns of a fit of terms: those of the free parameters, then each term's."""
        base = [(column, self.all_wheels) for column in self.nuisance.columns]
        return tuple(base + [(column, term.wheels) for term in terms for column in term.group.columns])

    @cached_property
    def _of_parameters(self) -> tuple[Array, Array]:
        """Return the parameters' weighted sums in double precision, shapes (wheel, row, column) and (wheel, column).

        Of parameters with wide priors, combinations that hardly change the prediction are held by these alone.
        """
        products, moments = self.design.precise_sums(self.nuisance.columns)
        return self._weighted(products), self._weighted(moments)

    def _normal(self, columns: Columns) -> tuple[Array, Array]:
        """Return matrix and moment of the normal equations of these columns, the priors included."""
        index = [column for column, _ in columns]
        share = membership(columns, len(self.weights))
        base = len(self.nuisance.columns)
        products, moments = self.products(index, index), self.moment[:, index]
        products[:, :base, :base], moments[:, :base] = self._of_parameters
        matrix = np.zeros((len(columns), len(columns)))
        for w in self.all_wheels:
            matrix += np.outer(share[:, w], share[:, w]) * products[w]
        matrix[range(base), range(base)] += self.nuisance.precision
        moment = np.einsum("cw,wc->c", share, moments)
        moment[:base] += self.nuisance.precision * self.nuisance.centre
        return matrix, moment


def normal_equations(
    design: DesignMatrix, nuisance: Nuisance, weights: Array, folds: Sequence[int] | None = None
) -> NormalEquations:
    """Return the equations on some folds; on all of them where none are given."""
    return NormalEquations(design, nuisance, weights, tuple(range(design.folds) if folds is None else folds))


def information_of_some(
    matrix: Array, moment: Array, errors: Array, nuisance: Nuisance, kept: Sequence[int], singular: float
) -> tuple[Array, Array]:
    """Return the information matrix and vector of some free parameters beside all other columns, without their priors.

    Parameters
    ----------
    matrix, moment: of the normal equations, the priors included; the free parameters are the first columns
    errors: moments of the columns with draws of the inputs' errors that last, shape (draw, column)
    nuisance: the priors
    kept: places of the parameters
    singular: relative eigenvalue below which a direction counts as undetermined
    """
    own, rest = np.array(kept, np.int64), np.setdiff1d(np.arange(len(matrix)), kept)
    precision = nuisance.precision[own]
    cross = matrix[np.ix_(rest, own)]
    inverse = pseudo_inverse(matrix[np.ix_(rest, rest)], singular)
    left = schur_complement(matrix[np.ix_(own, own)] - np.diag(precision), cross, inverse)
    vector = moment[own] - precision * nuisance.centre[own] - cross.T @ inverse @ moment[rest]
    if not len(errors):
        return left, vector
    added = covariance_of_scores(errors[:, own] - errors[:, rest] @ inverse @ cross)
    share = left @ pseudo_inverse(left + added, singular)
    return share @ left, share @ vector


def membership(columns: Columns, wheel_count: int) -> Array:
    """Return 1 where a column acts on a wheel, else 0, shape (column, wheel)."""
    share = np.zeros((len(columns), wheel_count))
    for row, (_, wheels) in enumerate(columns):
        share[row, list(wheels)] = 1
    return share
