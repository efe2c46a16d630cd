"""Shape parameters between the grid's points: an onset to the second, a Stribeck speed, an order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.normal_equations import add_candidate
from regolithd.calibration.mismatch.selection.subset_selection import Search, Term

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape

Array = NDArray[np.float64]

GOLDEN = (np.sqrt(5) - 1) / 2
SETTLES = 4


class Profile:
    """The gain of one candidate as a function of its shape, with other terms in the fit."""

    def __init__(self, search: Search, others: Sequence[Term], candidate: Candidate, wheels: tuple[int, ...]) -> None:
        self.search, self.candidate, self.wheels = search, candidate, wheels
        dictionary = search.dictionary
        fitted = search.fit(others)
        self._problem = dictionary.problem
        count = dictionary.columns.shape[2]
        self._others = np.zeros((len(fitted.columns), len(wheels), count), np.float32)
        for row, (column, on) in enumerate(fitted.columns):
            for place, wheel in enumerate(wheels):
                if wheel in on:
                    self._others[row, place] = dictionary.columns[column, wheel]
        self._inverse = fitted.covariance
        self._weights = np.sqrt(search.weights[list(wheels)])[:, None].astype(np.float32)
        residual = dictionary.residual[list(wheels)].astype(np.float64)
        residual -= np.einsum("r,rwt->wt", fitted.coefficients, self._others, optimize=True)
        self._left = (residual * self._weights).astype(np.float32)
        self._flat = (self._others * self._weights).reshape(len(self._others), -1)

    def along(self, shape: Shape, name: str) -> Callable[[float], float]:
        """Return the gain as a function of one shape parameter."""
        return lambda value: self({**shape, name: value})

    def __call__(self, shape: Shape) -> float:
        """Return the further gain."""
        dictionary = self.search.dictionary
        columns = np.asarray(self.candidate.columns(self._problem, shape), np.float64)
        kept = np.where(self._problem.mask, columns, 0.0)[:, :, list(self.wheels)]
        fresh = np.swapaxes(kept, 1, 2)[:, :, dictionary.order].astype(np.float32) * self._weights
        rows = fresh.reshape(len(fresh), -1)
        cross = (rows @ self._flat.T).astype(np.float64)
        matrix = (rows @ rows.T).astype(np.float64)
        own = np.max(np.diag(matrix))
        matrix -= cross @ self._inverse @ cross.T
        moment = (rows @ self._left.ravel()).astype(np.float64)
        values, vectors = np.linalg.eigh(matrix)
        good = values > 1e-3 * own
        along = vectors[:, good].T @ moment
        coefficients = vectors[:, good] @ (along / values[good])
        signs = [c.sign for c in self.candidate.coefficients[: len(rows)]]
        if any(s * c < 0 for s, c in zip(signs, coefficients, strict=False)):
            return 0.0
        return float(np.sum(along**2 / values[good]))


def refined(search: Search, others: Sequence[Term], term: Term) -> Term:
    """Return the term with its free shape parameters where they gain most; the dictionary gains its columns."""
    candidate = term.group.candidate
    if candidate is None:
        return term
    if not any(name in term.group.shape for name in candidate.free):
        return _settled(search, others, term)
    profile = Profile(search, others, candidate, term.wheels)
    best, gain = dict(term.group.shape), profile(term.group.shape)
    problem = search.dictionary.problem
    for name, (low, high) in candidate.bounds(problem, best).items():
        if name not in best:
            continue
        reach = _reach(problem.length_s, name, float(best[name]), low, high)
        value, found = maximise(profile.along(best, name), *reach)
        if found > gain:
            best, gain = {**best, name: value}, found
    return _settled(search, others, _reshaped(search, term, best))


def _settled(search: Search, others: Sequence[Term], term: Term) -> Term:
    """Return the term with a shape that agrees with its coefficients, as far as a few steps lead there."""
    for _ in range(SETTLES):
        if (candidate := term.group.candidate) is None:
            break
        fit = search.fit((*others, term))
        scale = search.dictionary.scale[list(term.group.columns)]
        values = fit.coefficients[fit.of_term(len(others))] / scale
        settled = candidate.self_consistent_shape(search.dictionary.problem, term.group.shape, values.tolist())
        if settled == term.group.shape:
            break
        term = _reshaped(search, term, settled)
    return term


def _reshaped(search: Search, term: Term, shape: Shape) -> Term:
    """Return the term in another shape; the dictionary gains its columns."""
    candidate = term.group.candidate
    if candidate is None or shape == term.group.shape:
        return term
    (group,) = add_candidate(search.dictionary, candidate, [shape], [term.group.quieter])
    search.refresh()
    return Term(group, term.wheels)


def _reach(length_s: float, name: str, at: float, low: float, high: float) -> tuple[float, float]:
    """Return where to look: to the neighbouring points of the grid."""
    if name == "onset_s":
        return max(low, at - 0.05 * length_s), min(high, at + 0.05 * length_s)
    spread = 0.35 * max(abs(at), 0.2 * (high - low))
    return max(low, at - spread), min(high, at + spread)


def maximise(function: Callable[[float], float], low: float, high: float, steps: int = 14) -> tuple[float, float]:
    """Return argument and value of the largest of a coarse scan, then golden sections around it."""
    points = np.linspace(low, high, 7)
    values = [function(float(x)) for x in points]
    top = int(np.argmax(values))
    a, b = float(points[max(top - 1, 0)]), float(points[min(top + 1, 6)])
    best, value = float(points[top]), values[top]
    c, d = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
    fc, fd = function(c), function(d)
    for _ in range(steps):
        if fc > fd:
            b, d, fd = d, c, fc
            c = b - GOLDEN * (b - a)
            fc = function(c)
        else:
            a, c, fc = c, d, fd
            d = a + GOLDEN * (b - a)
            fd = function(d)
    for x, f in ((c, fc), (d, fd)):
        if f > value:
            best, value = x, f
    return best, value
