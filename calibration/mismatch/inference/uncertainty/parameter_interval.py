"""A parameter's 90 % interval from draws, within its declared bounds and never with its value on an end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.answer import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]

NINE_TENTHS = (0.05, 0.95)
"""Quantiles of a 90 % interval."""
LEAST_MARGIN = 0.05
"""Share of the interval's width by which it reaches beyond its value (a choice: a value is never its own bound)."""
MIDDLE_HALF = (0.25, 0.75)
"""Quantiles between which a value is told that a declared bound holds (a choice: its best value is no centre)."""
FEWEST_DRAWS_WITHIN = 20
"""Draws within the declared bounds from which quantiles are taken (a choice: one is then below the 5 % quantile)."""


def interval(
    value: float, drawn: Sequence[float] | Array, unit: str, bounds: tuple[float, float] | None = None
) -> Parameter:
    """Return a value with the bounds of its draws; a value outside of them widens the interval beyond itself.

    Where `bounds` are declared, draws beyond them are impossible: those within are the posterior. A best value near a
    bound is then no centre of it, and the nearest in the middle half of the posterior is returned instead. Where so
    many draws are beyond one bound that its equal-tailed interval would leave the bound out, the interval ends there.
    """
    least, most = bounds or (-np.inf, np.inf)
    everywhere = np.asarray(drawn, np.float64)
    inside = everywhere[(everywhere >= least) & (everywhere <= most)]
    bounded = len(inside) < len(everywhere)
    if len(inside) < FEWEST_DRAWS_WITHIN:
        inside = np.clip(_tail(everywhere, least, most), least, most)
    low, high = _ends(inside, everywhere, least, most)
    if bounded or not least < value < most:
        value = float(np.clip(value, *np.quantile(inside, MIDDLE_HALF)))
    margin = LEAST_MARGIN * (high - low)
    return Parameter(value, max(min(low, value - margin), least), min(max(high, value + margin), most), unit)


def _ends(inside: Array, everywhere: Array, least: float, most: float) -> tuple[float, float]:
    """Return what nine tenths of the draws within the bounds are between: a bound, where a tail is beyond that one.

    A power that is exactly 1, or a drag that is gone, is at its bound: an interval between 5 and 95 % never holds it.
    """
    tail, whole = NINE_TENTHS[0], NINE_TENTHS[1] - NINE_TENTHS[0]
    at_least, at_most = bool(np.mean(everywhere < least) > tail), bool(np.mean(everywhere > most) > tail)
    if at_least == at_most:
        low, high = np.quantile(inside, NINE_TENTHS)
        return float(low), float(high)
    if at_least:
        return least, float(np.quantile(inside, whole))
    return float(np.quantile(inside, 1 - whole)), most


def _tail(drawn: Array, least: float, most: float) -> Array:
    """Return quantiles of what the density of draws nearly all beyond a bound leaves within it.

    A normal density falls exponentially there, by a factor e over σ²/d at a distance d of the bound from its mean.
    """
    mean, variance = float(np.mean(drawn)), float(np.var(drawn))
    bound, inwards = (least, 1.0) if mean < least else (most, -1.0)
    if variance == 0 or least <= mean <= most:
        return drawn
    quantiles = (np.arange(len(drawn)) + 0.5) / len(drawn)
    return np.asarray(bound - inwards * variance / abs(mean - bound) * np.log1p(-quantiles))
