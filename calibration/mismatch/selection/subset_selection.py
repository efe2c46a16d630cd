"""The search: which set of terms, on which wheels, explains most, each paying for the freedom it had.

A set's gain is what it takes from the weighted sum of squares beyond what the free parameters, held by their priors,
take already; in units of the long-run noise variance, so that twice a log-likelihood ratio is meant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from regolithd.calibration.mismatch.regression.design_matrix import Dictionary, Group
    from regolithd.calibration.mismatch.regression.normal_equations import Nuisance

Array = NDArray[np.float64]

OUTSIDE_REACH = 1e-3
"""A column of which less than this share of energy lies outside all others' reach is one of theirs."""
VISIBLE = 25.0
"""Gain in its own channel below which a fault is not there."""
BONUS_SHARE, MOST_BONUS = 0.5, 300.0
PER_COEFFICIENT = 2.0
"""Paid for each coefficient, as in Akaike's criterion: what a coefficient gains by chance is 1 on average."""


@dataclass(frozen=True)
class Term:
    """A group on some wheels."""

    group: Group
    wheels: tuple[int, ...]
    """Indices, not names."""

    @property
    def name(self) -> str:
        """The candidate's or the covariate's."""
        return self.group.name

    def price(self, wheel_count: int) -> float:
        """Return what choosing this term costs: its coefficients, its shape, and that it is on these wheels."""
        alive = self.group.alive
        count = len(self.group.columns) if alive is None else np.sum(alive[:, list(self.wheels)].any(axis=1))
        paid = PER_COEFFICIENT * float(count) + self.group.complexity
        if len(self.wheels) < wheel_count:
            paid += 2 * float(np.log(2 * wheel_count))
            # One wheel alone is the rule for some faults and the exception for what all wheels are built with.
            paid += 6.0 if "all" in self.group.sharing else 0.0
        return paid - self.bonus

    @property
    def bonus(self) -> float:
        """What the fault's own channel pays towards it: one cause for two signs needs no coincidence."""
        if self.group.evidence is None:
            return 0.0
        return min(BONUS_SHARE * float(np.sum(self.group.evidence[0][list(self.wheels)])), MOST_BONUS)

    @property
    def visible(self) -> bool:
        """Whether the fault's own channel shows it, where it has one."""
        return self.group.evidence is None or float(np.sum(self.group.evidence[0][list(self.wheels)])) > VISIBLE


@dataclass(frozen=True)
class Fit:
    """Terms fitted together with the free parameters."""

    terms: tuple[Term, ...]
    columns: tuple[tuple[int, tuple[int, ...]], ...]
    """(column, wheels) of every coefficient: the free parameters' first."""
    coefficients: Array
    covariance: Array
    """For white noise of the long-run variance."""
    gain: float

    def of_term(self, index: int) -> slice:
        """Where the coefficients of a term are."""
        start = len(self.columns) - sum(len(t.group.columns) for t in self.terms)
        start += sum(len(t.group.columns) for t in self.terms[:index])
        return slice(start, start + len(self.terms[index].group.columns))


def shared(group: Group, kind: str) -> bool:
    """Say whether wheels of this kind may share a group; what may be on one or on all may be on a side or a row."""
    return kind in group.sharing or (kind == "some" and group.named and len(group.sharing) > 1)


class Search:
    """Gains of sets of terms, on given folds, with given weights of the wheels."""

    def __init__(
        self, dictionary: Dictionary, nuisance: Nuisance, weights: Array, folds: Sequence[int] | None = None
    ) -> None:
        self.dictionary = dictionary
        self.nuisance = nuisance
        self.weights = weights
        self.threshold = 10.0
        """The score that a name must earn; `null.naming_threshold` sets it."""
        self.folds = list(range(len(dictionary.gram))) if folds is None else list(folds)
        self.gram: Array = np.zeros((0, 0, 0))
        self._weighed: Array = np.zeros(0)
        self.refresh()

    def refresh(self) -> None:
        """Take in new weights, and columns that were added to the dictionary since."""
        size, old = len(self.dictionary.scale), 0
        if len(self.gram) and np.array_equal(self.weights, self._weighed):
            old = self.gram.shape[1]
        gram = np.zeros((len(self.weights), size, size))
        if old:
            gram[:, :old, :old] = self.gram
        for fold in self.folds:
            gram[:, old:, :] += self.dictionary.gram[fold][:, old:, :]
        gram[:, old:, :] *= self.weights[:, None, None]
        gram[:, :old, old:] = np.swapaxes(gram[:, old:, :old], 1, 2)
        self.gram, self._weighed = gram, self.weights
        self.moment = self.dictionary.moment[self.folds].sum(axis=0) * self.weights[:, None]

    @property
    def patterns(self) -> dict[tuple[int, ...], str]:
        """Wheels that may share an effect: all, each alone, a side, a row; and which of these it is."""
        problem = self.dictionary.problem
        found = {self.all_wheels: "all"}
        for place in (problem.side, problem.row):
            for value in np.unique(place) if place is not None else ():
                found.setdefault(tuple(int(w) for w in np.flatnonzero(place == value)), "some")
        return {**{(w,): "one" for w in self.all_wheels}, **found}

    @property
    def all_wheels(self) -> tuple[int, ...]:
        """Indices of all wheels."""
        return tuple(range(len(self.weights)))

    def fit(self, terms: Iterable[Term]) -> Fit:
        """Fit terms and free parameters together."""
        terms = tuple(terms)
        columns = self._columns(terms)
        matrix, moment = self._normal(columns)
        base = len(self.nuisance.columns)
        inverse: Array = np.linalg.pinv(matrix, rcond=1e-10, hermitian=True).astype(np.float64)
        solved = inverse @ moment
        gain = float(moment @ solved)
        if base:
            gain -= float(moment[:base] @ np.linalg.solve(matrix[:base, :base], moment[:base]))
        return Fit(terms, columns, solved, inverse, gain)

    def score(self, fit: Fit) -> float:
        """Return the gain less the prices; what lives where there is little noise gains by so much more."""
        gain = fit.gain
        for index, term in enumerate(fit.terms):
            if term.group.quieter > 1:
                values, span = fit.coefficients[fit.of_term(index)], term.group.span
                own = sum(float(values @ self.gram[w][span, span] @ values) for w in term.wheels)
                gain += (term.group.quieter - 1) * own
        return gain - sum(term.price(len(self.weights)) for term in fit.terms)

    def conditional(self, given: Iterable[Term], groups: Sequence[Group] | None = None) -> list[tuple[float, Term]]:
        """Return the further gain of every group beside `given`, on all wheels and on each alone."""
        wanted = self.dictionary.groups if groups is None else groups
        fitted = self.fit(given)
        at = np.array(sorted({column for group in wanted for column in group.columns}), np.int64)
        place = {int(column): k for k, column in enumerate(at)}
        index = np.array([column for column, _ in fitted.columns], np.int64)
        own = self.gram[:, at, at]
        found: list[tuple[float, Term]] = []
        for pattern, kind in self.patterns.items():
            chosen = list(pattern)
            sharing = [group for group in wanted if shared(group, kind) or len(self.weights) == 1]
            reach = np.zeros((len(index), len(at)))
            for w in chosen:
                on = np.array([w in wheels for _, wheels in fitted.columns], np.float64)
                reach += on[:, None] * self.gram[w][np.ix_(index, at)]
            solved = fitted.covariance @ reach
            left = self.moment[chosen][:, at].sum(axis=0) - fitted.coefficients @ reach
            total = own[chosen].sum(axis=0)
            single = total - np.einsum("sp,sp->p", reach, solved)
            gains = np.where(single > OUTSIDE_REACH * total, left**2 / np.where(single > 0, single, 1.0), 0.0)
            for group in sharing:
                here = [place[column] for column in group.columns]
                if len(here) == 1:
                    gain = float(gains[here[0]]) if group.signs[0] * left[here[0]] >= 0 else 0.0
                else:
                    block = _summed([self.gram[w][group.span, group.span] for w in chosen])
                    gain = _gain(group.signs, left[here], block, reach[:, here].T @ solved[:, here])
                term = Term(group, pattern)
                if gain > 0 and term.visible:
                    found.append((gain * group.quieter, term))
        return found

    def beside(self, given: Iterable[Term], term: Term) -> tuple[Array, Array]:
        """Return a term's own sums of products, and the part of them that `given` and the free parameters reach."""
        columns = self._columns((*given, term))
        size = len(columns) - len(term.group.columns)
        matrix, _ = self._normal(columns)
        cross = matrix[:size, size:]
        inverse = np.linalg.pinv(matrix[:size, :size], rcond=1e-10, hermitian=True) if size else np.zeros((0, 0))
        return matrix[size:, size:], cross.T @ inverse @ cross

    def share_outside(self, given: Iterable[Term], term: Term) -> float:
        """Return the share of a term's energy that nothing else in the fit reaches."""
        block, reach = self.beside(given, term)
        return float((block - reach)[0, 0] / max(float(block[0, 0]), 1e-300))

    def _columns(self, terms: tuple[Term, ...]) -> tuple[tuple[int, tuple[int, ...]], ...]:
        base = [(column, self.all_wheels) for column in self.nuisance.columns]
        return tuple(base + [(column, term.wheels) for term in terms for column in term.group.columns])

    def _normal(self, columns: Sequence[tuple[int, tuple[int, ...]]]) -> tuple[Array, Array]:
        index = [c for c, _ in columns]
        share = np.zeros((len(columns), len(self.weights)))
        for row, (_, wheels) in enumerate(columns):
            share[row, list(wheels)] = 1
        matrix = np.zeros((len(columns), len(columns)))
        for w in self.all_wheels:
            matrix += np.outer(share[:, w], share[:, w]) * self.gram[w][np.ix_(index, index)]
        base = len(self.nuisance.columns)
        matrix[range(base), range(base)] += self.nuisance.precision
        moment = np.einsum("cw,wc->c", share, self.moment[:, index])
        return matrix, moment


def _summed(blocks: Sequence[Array]) -> Array:
    total = blocks[0].copy()
    for block in blocks[1:]:
        total += block
    return total


def _gain(signs: tuple[int, ...], left: Array, block: Array, reached: Array) -> float:
    """Return what several columns add: zero where a coefficient has the wrong sign, or nothing of them is new."""
    values, vectors = np.linalg.eigh(block - reached)
    kept = values > OUTSIDE_REACH * np.max(np.diag(block))
    along = vectors[:, kept].T @ left
    coefficients = vectors[:, kept] @ (along / values[kept])
    if any(sign * value < 0 for sign, value in zip(signs, coefficients, strict=True)):
        return 0.0
    return float(np.sum(along**2 / values[kept]))
