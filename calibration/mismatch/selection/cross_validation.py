"""Whether what a term gains comes back on data that did not fit it: on other runs, or other blocks of time.

On stationary data a sum of cross-validated gains is the gain in sample less about two for each coefficient. Where far
less comes back, the coefficient differs from run to run: the term describes an occasion, not the machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.selection.subset_selection import Fit, Search, Term

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]

COMES_BACK = 0.5
"""The least share of a term's gain that must come back where it was not fitted."""


def squares(train: Search, fit: Fit, fold: int) -> Array:
    """Return the sum of squared errors of a fit on a fold, for each wheel."""
    dictionary = train.dictionary
    total = dictionary.energy[fold].copy()
    for w in range(len(total)):
        on = [(c, v) for (c, wheels), v in zip(fit.columns, fit.coefficients, strict=True) if w in wheels]
        if not on:
            continue
        at = [c for c, _ in on]
        values = np.array([v for _, v in on])
        total[w] += (
            values @ dictionary.gram[fold, w][np.ix_(at, at)] @ values - 2 * values @ dictionary.moment[fold, w, at]
        )
    return total


def gains_elsewhere(search: Search, terms: Sequence[Term], index: int) -> Array:
    """Return what a term gains on each fold when the others fitted it, shape (fold,)."""
    rest = [term for i, term in enumerate(terms) if i != index]
    count = len(search.dictionary.gram)
    gains = np.zeros(count)
    for fold in range(count):
        others = [f for f in range(count) if f != fold] or [fold]
        train = Search(search.dictionary, search.nuisance, search.weights, others)
        saved = squares(train, train.fit(rest), fold) - squares(train, train.fit(terms), fold)
        gains[fold] = float(np.sum(saved * search.weights))
    return gains


def margin(search: Search, terms: Sequence[Term], index: int, enough: float) -> float:
    """Return by how much a term transfers: not at all where negative.

    At least half of its gain must come back; and where folds are whole runs, the best of them left out, what the others
    say must still be `enough` for a name: a finding that hangs on one run is none.
    """
    rest = [term for i, term in enumerate(terms) if i != index]
    gains = gains_elsewhere(search, terms, index)
    # Of a gain that the priors alone pay (a parameter need not stray), no data can give anything back: what the data
    # gained is asked for. A coefficient that was fitted costs about two on data that did not fit it.
    gained = sum(
        float((squares(search, search.fit(rest), fold) - squares(search, search.fit(terms), fold)) @ search.weights)
        for fold in range(len(gains))
    )
    found = float(gains.sum()) + 2 * len(terms[index].group.columns) - COMES_BACK * gained
    if len(np.unique(search.dictionary.problem.recording.run)) < len(gains):
        return found
    return min(found, float(gains.sum() - gains.max()) - enough - terms[index].price(len(search.weights)))


def that_transfer(search: Search, named: Fit, enough: float) -> Fit:
    """Leave out terms that do not transfer, the worst first, until all that stay do."""
    while named.terms:
        margins = [margin(search, named.terms, index, enough) for index in range(len(named.terms))]
        worst = int(np.argmin(margins))
        if margins[worst] >= 0:
            break
        named = search.fit([term for index, term in enumerate(named.terms) if index != worst])
    return named
