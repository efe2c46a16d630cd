"""Whether a residual follows what was before, and not what comes later: dynamics act forwards in time only.

Errors of the inputs that a prediction is computed from, a clock that is off, and a controller that answers to a
reading's noise relate a residual to what comes later as well as to what was before, or to that alone. So does nothing
that a machine does. (The test of Sims, 1972: of a regression on past and future, the future's coefficients are zero.)
What is up to one reading late stays out of it: a sampled input does not say what it was between two readings.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.regression.group import Term

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

MOST_OF_LATER = 0.25
"""Δχ² of what comes later, as a share of that of what was before, each beside the other, up to which the past acts (a
choice: in strangers' trials it was 0 to 0.05 of what rings or lags)."""


def acts_forwards(equations: NormalEquations, given: Sequence[Term], term: Term) -> bool:
    """Return whether a smooth term is none over what was before, or follows that beside what comes later."""
    if not term.group.later:
        return True
    last, *before = term.group.columns
    later = _of(term, term.group.later)
    both = equations.fit((*given, later, term)).delta_chi2
    of_later = both - equations.fit((*given, term)).delta_chi2
    of_past = both - equations.fit((*given, later)).delta_chi2
    beside = _of(term, (*term.group.later, last))
    beyond = both - equations.fit((*given, beside)).delta_chi2
    limits = equations.thresholds
    least = limits.smooth_term_entry + limits.coefficient_penalty * len(before)
    return of_later < MOST_OF_LATER * of_past and beyond > least


def _of(term: Term, columns: tuple[int, ...]) -> Term:
    """Return the term with other columns."""
    return Term(replace(term.group, columns=columns, signs=(0,) * len(columns), later=()), term.wheels)
