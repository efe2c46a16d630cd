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
ON_THE_BOUND = 0.01
"""Distance to a declared bound, as a share of the range, within which a value stands on it (a choice)."""
FEWEST_DRAWS_WITHIN = 20
"""Draws within the declared bounds from which quantiles are taken (a choice: one is then below the 5 % quantile)."""


def interval(
    value: float, drawn: Sequence[float] | Array, unit: str, bounds: tuple[float, float] | None = None
) -> Parameter:
    """Return a value with the bounds of its draws; a value outside of them widens the interval beyond itself.

    Where `bounds` are declared, draws beyond them are impossible: those within are the posterior. A best value that
    stands on a bound is then no centre of it, and its median is returned instead.
    """
    least, most = bounds or (-np.inf, np.inf)
    inside = np.asarray(drawn, np.float64)
    inside = inside[(inside >= least) & (inside <= most)]
    if len(inside) < FEWEST_DRAWS_WITHIN:
        inside = np.clip(drawn, least, most)
    low, high = (float(bound) for bound in np.quantile(inside, NINE_TENTHS))
    edge = ON_THE_BOUND * (most - least) if np.isfinite(most - least) else 0.0
    if not least + edge < value < most - edge:
        value = float(np.median(inside))
    margin = LEAST_MARGIN * (high - low)
    return Parameter(value, max(min(low, value - margin), least), min(max(high, value + margin), most), unit)
