"""The margin that an experiment is expected to put between answers: what one predicts and another cannot reproduce.

Where answer k is true, the experiment shows what k predicts. Answer l explains of it what its own law, with a new
coefficient and in any of its shapes, the effects that both have, and the free parameters, held by their priors, can
reproduce. The sum of squares that is left, over the long-run variance of the recording's noise, is the expected
Δχ² of k over l: twice the expected difference of their log likelihoods (the energy of what separates two models; Hunter
and Reiner, 1965, choose experiments by it).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import columns_of
from regolithd.calibration.mismatch.experiments.settings import NOT_SET
from regolithd.calibration.mismatch.regression.normal_equations import SINGULAR
from regolithd.calibration.mismatch.regression.residuals import relative_size
from regolithd.calibration.mismatch.regression.screening.schur import pseudo_inverse

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.experiments.drives import Drive
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]
Pair = tuple[str, str]

MOST_SHAPES = 12
"""Shapes of a law that another answer is held against (a choice: computing time)."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One answer: a law on some wheels with the coefficients that the recording gives it, or a wrong parameter.

    Attributes
    ----------
    name: of the effect, or of the parameter as an effect
    term: the law; None: a parameter
    coefficients: of the law's columns as the candidate returns them
    more, more_coefficients: a second law that acts beside it, and its coefficients; None: there is none
    place: of the parameter among the free ones
    shift: by how much it would have to be wrong
    """

    name: str
    term: Term | None = None
    coefficients: tuple[float, ...] = ()
    more: Term | None = None
    more_coefficients: tuple[float, ...] = ()
    place: int | None = None
    shift: float = 0.0

    def adds_to(self, other: Hypothesis) -> bool:
        """Return whether this is the law of another answer with a second one beside it."""
        alone = self.more is not None and other.more is None
        return (
            alone and self.term is not None and other.term is not None and self.term.group.law == other.term.group.law
        )


def of_effect(equations: NormalEquations, given: Sequence[Term], term: Term) -> Hypothesis:
    """Return the hypothesis of an effect, with the size that the recording gives it beside `given`.

    It is at least the smallest that an experiment must show: of an effect that is not there, how large it would be.
    """
    others = [each for each in given if each is not term]
    fit = equations.fit((*others, term))
    index = len(fit.terms) - 1
    scaled = fit.coefficients[fit.of_term(index)]
    factor = _at_least(equations, fit, index)
    columns = list(term.group.columns)
    return Hypothesis(term.name, term, tuple((factor * scaled / equations.design.scale[columns]).tolist()))


def of_both(equations: NormalEquations, given: Sequence[Term], law: Term, more: Term) -> Hypothesis:
    """Return the hypothesis that a law acts in this shape and `more` beside it, each as large as the recording says."""
    fit = equations.fit((*(each for each in given if each is not law), law, more))
    sizes = [
        fit.coefficients[fit.of_term(len(fit.terms) - 2 + place)] / equations.design.scale[list(term.group.columns)]
        for place, term in enumerate((law, more))
    ]
    of_law, of_more = (tuple(size.tolist()) for size in sizes)
    return Hypothesis(f"{law.name} with {more.name}", law, of_law, more, of_more)


def of_parameter(equations: NormalEquations, given: Sequence[Term], effect_name: str) -> Hypothesis | None:
    """Return the hypothesis that a parameter is as wrong as the recording suggests; None: there is no such."""
    names, nuisance = equations.problem.simulation.parameter_effects, equations.nuisance
    place = next((k for k, name in enumerate(nuisance.names) if names.get(name) == effect_name), None)
    if place is None:
        return None
    fit = equations.with_nuisance(nuisance.with_precision(place, 0.0)).fit(given)
    scaled, scale = float(fit.coefficients[place]), float(equations.design.scale[nuisance.columns[place]])
    # A scaled column has a root mean square of 1: its coefficient is how much it changes the channel.
    least = equations.thresholds.effect_of_experiment * equations.problem.mean_size
    scaled = scaled if abs(scaled) > least else float(np.copysign(least, scaled))
    return Hypothesis(effect_name, place=place, shift=scaled / scale)


def predictable(term: Term) -> bool:
    """Return whether what a law does on another drive follows from the drive alone."""
    candidate = term.group.candidate
    if candidate is None or candidate.channel is not None:
        return False
    return candidate.covariate not in NOT_SET and candidate.change_point not in term.group.shape


def _at_least(equations: NormalEquations, fit: Fit, index: int) -> float:
    """Return the factor that makes a term as large as the smallest that an experiment must show, at least 1."""
    size = relative_size(equations, fit, index)
    return max(equations.thresholds.effect_of_experiment / max(size, 1e-9), 1.0)


@dataclass(frozen=True, eq=False)
class Expected:
    """What is expected of one drive: sums of products of all that answers can explain with what each predicts.

    Attributes
    ----------
    gram: of a drive of one second, shape (column, column)
    precision: of the free parameters, the first columns, shape (parameter,)
    given: columns of the effects that all answers have
    of_law: for each hypothesis, the columns of its law in each of its shapes
    predicted: the column that holds what each hypothesis predicts
    hypotheses: the answers
    """

    gram: Array
    precision: Array
    given: tuple[int, ...]
    of_law: tuple[tuple[tuple[int, ...], ...], ...]
    predicted: tuple[int, ...]
    hypotheses: tuple[Hypothesis, ...]

    def margins(self, duration_s: float) -> dict[Pair, float]:
        """Return the Δχ² that is expected of such a duration between every two effects, or an effect and parameters.

        It is the mean of the two cases, since nobody knows which of the two is true; 0 where the sums overflow. Where
        one of them is the other with a second law, it is what that law would show: without it, both explain the same.
        """
        count = len(self.hypotheses)
        finite = bool(np.isfinite(self.gram).all() and np.isfinite(self.precision).all())
        left = np.stack([self._left_by(k, duration_s) for k in range(count)]) if finite else np.zeros((count, count))
        names = [one.name for one in self.hypotheses]
        # That a parameter is wrong by more than its prior allows is an answer where there is one effect alone.
        effects = [place for place, one in enumerate(self.hypotheses) if one.term is not None]
        counted = effects if len(effects) > 1 else range(len(names))
        pairs = [(a, b) for a, b in combinations(counted, 2) if a in effects or b in effects]

        def margin(a: int, b: int) -> float:
            if self.hypotheses[a].adds_to(self.hypotheses[b]):
                return float(left[b, a])
            if self.hypotheses[b].adds_to(self.hypotheses[a]):
                return float(left[a, b])
            return 0.5 * float(left[a, b] + left[b, a])

        return {(names[a], names[b]): margin(a, b) for a, b in pairs}

    def _left_by(self, other: int, duration_s: float) -> Array:
        """Return what an answer, in the best of its shapes, leaves of each one's prediction, shape (hypothesis,)."""
        precision = self.precision.copy()
        if (place := self.hypotheses[other].place) is not None:
            precision[place] = 0.0
        free = len(precision)
        shared = [*range(free), *self.given]
        matrix = self.gram[np.ix_(shared, shared)].copy()
        matrix[range(free), range(free)] += precision / duration_s
        cross = self.gram[shared]
        beyond = self.gram - cross.T @ pseudo_inverse(matrix, SINGULAR) @ cross
        of_all = list(self.predicted)
        alone = np.diag(beyond)[of_all]
        left = [alone - _explained(self.gram, beyond, list(law), of_all) for law in self.of_law[other]]
        return np.asarray(duration_s * np.maximum(np.min([alone, *left], axis=0), 0.0))


def _explained(gram: Array, beyond: Array, law: list[int], of_all: list[int]) -> Array:
    """Return what the columns of a law explain beyond what all answers have, shape (hypothesis,)."""
    moment = beyond[np.ix_(law, of_all)]
    size = np.maximum(np.diag(gram)[law], 1e-100)
    values, vectors = np.linalg.eigh(beyond[np.ix_(law, law)] / np.sqrt(np.outer(size, size)))
    kept = values > SINGULAR
    along = vectors[:, kept].T @ (moment / np.sqrt(size)[:, None])
    return np.asarray(np.sum(along**2 / values[kept, None], axis=0))


def expected_of(
    drive: Drive,
    hypotheses: Sequence[Hypothesis],
    given: Sequence[Term],
    *,
    precision: Array,
    information_per_s: Array,
) -> Expected:
    """Return what is expected of a drive; `information_per_s` is one over the noise's variance, shape (wheel,)."""
    columns: list[Array] = list(drive.tangents)
    given_at = _added(columns, (each for term in given for each in _columns(drive, term, term.group.shape)))
    of_law: list[tuple[tuple[int, ...], ...]] = []
    predicted: list[int] = []
    for one in hypotheses:
        if one.term is None:
            of_law.append(())
            predicted += _added(columns, [one.shift * drive.tangents[one.place or 0]])
            continue
        shown = np.tensordot(one.coefficients, _columns(drive, one.term, one.term.group.shape), 1)
        second: tuple[int, ...] = ()
        if one.more is not None:
            of_more = _columns(drive, one.more, one.more.group.shape)
            shown, second = shown + np.tensordot(one.more_coefficients, of_more, 1), _added(columns, of_more)
        predicted += _added(columns, [np.asarray(shown, np.float64)])
        shapes = _shapes(drive, one.term)
        of_law.append(tuple((*_added(columns, _columns(drive, one.term, shape)), *second) for shape in shapes))
    known = drive.problem.mask
    weights = np.sqrt(information_per_s / np.maximum(known.sum(axis=0), 1))
    # Single precision of the recording's own columns is not needed here: there are few rows.
    stacked = (np.where(known, np.stack(columns), 0.0) * weights).reshape(len(columns), -1)
    with np.errstate(over="ignore"):
        gram = stacked @ stacked.T
    return Expected(gram, precision, given_at, tuple(of_law), tuple(predicted), tuple(hypotheses))


def precisions(equations: NormalEquations) -> Array:
    """Return one over the prior variance of each free parameter in its own unit, shape (parameter,)."""
    nuisance = equations.nuisance
    return np.asarray(nuisance.precision * equations.design.scale[list(nuisance.columns)] ** 2)[: nuisance.count]


def worst(margins: Mapping[Pair, float], pairs: Sequence[Pair]) -> tuple[Pair, float]:
    """Return which of the pairs has the smallest margin, and that margin."""
    pair = min(pairs, key=lambda each: margins[each])
    return pair, margins[pair]


def _shapes(drive: Drive, term: Term) -> list[Shape]:
    """Return the shape that fits the recording, and further shapes of the same law."""
    candidate = _candidate(term)
    grid = list(candidate.shapes(drive.problem))
    chosen = np.unique(np.linspace(0, len(grid) - 1, min(len(grid), MOST_SHAPES)).astype(np.int64))
    return [term.group.shape, *(grid[k] for k in chosen if grid)]


def _columns(drive: Drive, term: Term, shape: Shape) -> Array:
    """Return a law's columns on a drive, 0 on other wheels and where the law has no part without load."""
    candidate = _candidate(term)
    with np.errstate(all="ignore"):  # a law may be undefined where there is no load
        found = columns_of(drive.problem, candidate, shape)
    found = np.where(np.isfinite(found), found, 0.0)
    on = np.zeros(drive.problem.mask.shape[1])
    on[list(term.wheels)] = 1.0
    return found * on * (1.0 if candidate.acts_unloaded else drive.loaded)


def _candidate(term: Term) -> Candidate:
    candidate = term.group.candidate
    assert candidate is not None  # noqa: S101  # `predictable` has seen to it
    return candidate


def _added(columns: list[Array], more: Iterable[Array]) -> tuple[int, ...]:
    """Append columns and return their places."""
    first = len(columns)
    columns.extend(more)
    return tuple(range(first, len(columns)))
