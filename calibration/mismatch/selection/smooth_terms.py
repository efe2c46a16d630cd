"""What has no name: curves that explain more than the names do, or much that they leave.

Where one covariate's curve explains clearly more than any name does, the names have not earned it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.regression.residuals import contribution, residual_of
from regolithd.calibration.mismatch.selection.best_subsets import (
    BESIDE_THE_UNKNOWN,
    UNNAMED_BY,
    acceptable,
    best_per_family,
    wandering,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.selection.subset_selection import Fit, Search, Term

WORTH_A_CURVE = 0.01
"""Of the residual's power on its wheels: what is less may be significant and is still nothing to worry about."""
SHAPE_MISFIT = 0.12
"""A name whose form explains all but this share of what a free curve could explain has the right form: nature's
friction curves are not ours to the last percent."""
ONE_IN_A_THOUSAND = 3.09
"""Quantile of the normal density."""


def without_a_name(search: Search, named: Fit, simpler: Sequence[Fit]) -> tuple[Fit, tuple[Term, ...]]:
    """Hold the names against curves that have none.

    A curve wins in two ways: beside the names, where it finds much that they leave; and against them, where one curve
    says more than several names of unlike covariates, which then only imitate it. But a single name that leaves
    nothing significant beside it is simpler than either.
    """
    alone = best_per_family(search, (), named=False)
    if not alone:
        return named, ()
    named = _that_stay(search, named)
    curve = alone[0][1]
    by_curve = search.fit((curve,))
    imitated = len(named.terms) > 1 and search.score(by_curve) > search.score(named) + search.threshold
    imitated &= any(_covariate(term) != curve.name for term in named.terms)
    for fit in simpler if imitated else ():
        if _left_over(search, fit) is None:
            return fit, ()
    left = _left_over(search, named)
    if left is None and not imitated:
        return named, ()
    kept: tuple[Term, ...] = ()
    fit = by_curve
    for term in named.terms:
        trial = search.fit((*kept, term, curve))
        if search.score(trial) - search.score(fit) > search.threshold and acceptable(search, trial):
            kept, fit = (*kept, term), trial
    if left is None or imitated or search.score(fit) >= search.score(search.fit((*named.terms, left))):
        return _that_stand_beside(search, search.fit(kept), curve), (curve,)
    return _that_stand_beside(search, named, left), (left,)


def _left_over(search: Search, named: Fit) -> Term | None:
    """Return the curve that finds much which the names leave, if one does."""
    curves = best_per_family(search, named.terms, named=False)
    left = [(score, term) for score, term in curves if not set(term.wheels) <= wandering(named)]
    if not left or left[0][0] <= UNNAMED_BY:
        return None
    beside = search.fit((*named.terms, left[0][1]))
    on = list(left[0][1].wheels)
    power = np.sum(contribution(search, beside, len(named.terms))[:, on] ** 2)
    if power < WORTH_A_CURVE * np.sum(residual_of(search, named)[:, on] ** 2):
        return None
    misfit = (beside.gain - named.gain) / max(beside.gain, 1e-9)
    return None if named.terms and misfit < SHAPE_MISFIT else left[0][1]


def _covariate(term: Term) -> str:
    """Return the covariate whose curve could imitate a term: that of speed, along the motion, holds a constant drag."""
    found = term.group.candidate.covariate if term.group.candidate else term.name
    return "wheel_speed" if found == "direction" else found


def _that_stand_beside(search: Search, named: Fit, curve: Term) -> Fit:
    """Leave out names that say little beside a curve that says much: what has no form leaks into every form."""
    both = search.fit((*named.terms, curve))
    unknown = both.gain - named.gain
    kept = []
    for index, term in enumerate(named.terms):
        rest = [*named.terms[:index], *named.terms[index + 1 :], curve]
        if both.gain - search.fit(rest).gain >= BESIDE_THE_UNKNOWN * unknown:
            kept.append(term)
    return search.fit(kept)


def _that_stay(search: Search, named: Fit) -> Fit:
    """Leave out changes that come and go: what wears or drives onto other soil does not heal.

    They show in a curve over time on the same wheels that is significant beside them; one covariate and one place need
    no price for having been chosen from many.
    """
    kept = []
    curves = [g for g in search.dictionary.groups if not g.named and g.name == "time" and "periodic" not in g.flavour]
    for term in named.terms:
        # What another channel shows by itself may come and go: a sensor does.
        changes = _covariate(term) == "time" and term.group.evidence is None
        beside = search.conditional(named.terms, curves) if changes else []
        more = [
            gain / (gain + named.gain)
            for gain, curve in beside
            if curve.wheels == term.wheels and gain > _by_chance(len(curve.group.columns))
        ]
        if max(more, default=0.0) < SHAPE_MISFIT:
            kept.append(term)
    return named if len(kept) == len(named.terms) else search.fit(kept)


def _by_chance(columns: int) -> float:
    """Return what that many coefficients gain one time in a thousand where nothing is (Wilson and Hilferty)."""
    spread = 2 / (9 * columns)
    return columns * (1 - spread + ONE_IN_A_THOUSAND * float(np.sqrt(spread))) ** 3
