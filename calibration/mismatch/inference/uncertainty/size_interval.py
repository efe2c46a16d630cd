"""The interval of an effect's relative size, over its coefficients and over the kinds of shape that fit as well."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.inference.uncertainty.parameter_interval import interval
from regolithd.calibration.mismatch.regression.residuals import where_it_acts

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.answer import Parameter
    from regolithd.calibration.mismatch.regression.group import Fit, Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]


def relative_size_interval(equations: NormalEquations, fit: Fit, index: int, columns: Array, moved: Array) -> Parameter:
    """Return the effect's root mean square on its wheels over the channel's mean magnitude.

    `columns` [column, time, wheel] are all that belong to the term, its coefficients' first; `moved` [draw, column] is
    how far each coefficient went in each draw.
    """
    problem, term = equations.problem, fit.terms[index]
    on = list(term.wheels)
    flat = columns[:, :, on].reshape(len(columns), -1)
    gram = flat @ flat.T / problem.mask[:, on].sum()
    drawn = moved.copy()
    drawn[:, : len(term.group.columns)] += fit.coefficients[fit.of_term(index)]
    sizes = np.sqrt(np.maximum(np.einsum("da,ab,db->d", drawn, gram, drawn), 0)) / problem.mean_size
    spread = equations.thresholds.size_discrepancy_std
    sizes *= np.exp(spread * np.random.default_rng(1).standard_normal(len(sizes)))
    value = _rms(equations, fit, index)
    return interval(value, np.concatenate(_over_kinds_of_shape(equations, fit, index, sizes, value)), "1")


def _rms(equations: NormalEquations, fit: Fit, index: int) -> float:
    """Return a term's root mean square over the channel's mean magnitude."""
    return float(np.sqrt(np.mean(where_it_acts(equations, fit, index) ** 2))) / equations.problem.mean_size


def _over_kinds_of_shape(equations: NormalEquations, fit: Fit, index: int, sizes: Array, value: float) -> list[Array]:
    """Return draws of the relative size for each kind of shape, in proportion to its likelihood.

    Where a reference temperature or the growth after an onset is unknown, so is what depends on it. `sizes` are draws
    for the fitted shape, `value` its best; another kind counts at its best shape with the same relative scatter.
    """
    others = fit.without(index)
    found = _best_of_each_kind(equations, fit.terms[index], others)
    best = max((gain for gain, _ in found), default=0.0)
    drawn = []
    for gain, term in found:
        likelihood_ratio = float(np.exp(0.5 * (gain - best)))
        if likelihood_ratio < equations.thresholds.least_likelihood_ratio:
            continue
        size = _rms(equations, equations.fit((*others, term)), len(others))
        drawn.append(size / max(value, 1e-30) * sizes[: max(int(likelihood_ratio * len(sizes)), 1)])
    return drawn or [sizes]


def _best_of_each_kind(equations: NormalEquations, term: Term, others: tuple[Term, ...]) -> list[tuple[float, Term]]:
    """Return the best shape of each kind, with its Δχ² less its prior's.

    A kind is a combination of parameters that are not continuous.
    """
    family = [group for group in equations.design.groups if group.named and group.law == term.group.law]
    free = term.group.candidate.free if term.group.candidate else {}
    found: dict[str, tuple[float, Term]] = {}
    for further, other in equations.further(others, family):
        gain = further - other.group.selection_penalty
        kind = str({name: value for name, value in other.group.shape.items() if name not in free})
        if other.wheels == term.wheels and (kind not in found or gain > found[kind][0]):
            found[kind] = gain, other
    return list(found.values())
