"""What silence is worth: for every candidate, the smallest effect that this recording would have shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Sensitivity
from regolithd.calibration.mismatch.regression.residuals import magnitude
from regolithd.calibration.mismatch.selection.best_subsets import WORTH_A_NAME
from regolithd.calibration.mismatch.selection.subset_selection import Term

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.selection.subset_selection import Fit, Search

NINE_IN_TEN = 1.2816
"""Quantile of the normal density: 9 times in 10 the gain's root is above its expectation less this."""


def sensitivities(search: Search, given: Fit, candidates: Sequence[Candidate]) -> tuple[Sensitivity, ...]:
    """Return root mean squares on the wheels concerned, in the channel's unit, with the effects found in the fit."""
    problem = search.dictionary.problem
    unit = problem.simulation.unit
    found = []
    for candidate in candidates:
        groups = [g for g in search.dictionary.groups if g.name == candidate.name and g.named]
        if not groups:
            found.append(Sensitivity(candidate.name, float("inf"), unit))
            continue
        # A shape in the middle of the grid stands for the family.
        group = groups[len(groups) // 2]
        wheels = search.all_wheels
        patterns = [wheels] if "all" in candidate.sharing or len(wheels) == 1 else [(w,) for w in wheels]
        # What was found already is looked for anew, not beside itself.
        others = [term for term in given.terms if term.name != candidate.name]
        sizes = [_smallest(search, others, Term(group, pattern)) for pattern in patterns]
        found.append(Sensitivity(candidate.name, float(np.median(sizes)), unit))
    return tuple(sorted(found, key=lambda s: s.name))


def _smallest(search: Search, given: Sequence[Term], term: Term) -> float:
    """Return the effect whose gain passes the threshold nine times in ten."""
    problem, dictionary = search.dictionary.problem, search.dictionary
    block, reach = search.beside(given, term)
    own = np.linalg.eigvalsh(block - reach)
    total = float(np.trace(block)) / len(block)
    price = term.price(len(search.weights)) + term.bonus
    needed = (np.sqrt(search.threshold + price) + NINE_IN_TEN) ** 2 / term.group.quieter
    outside = float(np.max(own))
    if outside <= 1e-9 * total:
        return float("inf")
    on = list(term.wheels)
    known = problem.mask.T[:, dictionary.order][on]
    power = np.mean(dictionary.columns[term.group.span][:, on].astype(np.float64) ** 2, axis=0)[known]
    rms = float(np.sqrt(np.mean(power)))
    least = WORTH_A_NAME * problem.mean_size / magnitude(power)
    return rms * max(float(np.sqrt(needed / outside)), least)
