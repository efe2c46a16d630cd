"""Which curves are looked for in all recordings of a fleet together, and between which values."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.fleet.work.fleet_curve import FleetCurve
from regolithd.calibration.mismatch.fleet.work.grid import GridGroup
from regolithd.calibration.mismatch.regression.groups.smooth_groups import EACH_WAY, SINES
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.fleet.work.found import Found

MOST_CURVES = 20
"""Curves that are looked for, at most (a choice: computing time)."""
MOST_BYTES = 192 * 2**20
"""Memory of the sums of products of all recordings that curves may make necessary (a choice)."""
OF_ONE_RECORDING = frozenset({"time"})
"""Covariates that begin anew in each recording: nothing is a function of them in several."""


def with_curves_of(grid: Sequence[GridGroup], found: Sequence[Found]) -> tuple[GridGroup, ...]:
    """Return the groups of a grid, and those of curves: what recordings show by themselves, and the usual ones.

    As many as memory allows, those that most recordings show first. What has no name in a recording is often a law of
    all of them; where it is weak, none shows it.
    """
    wanted = _wanted(found)
    columns = sum(len(group.columns) for group in grid)
    allowed = np.sqrt(MOST_BYTES / (8 * max(sum(len(each.deviation) for each in found), 1))) - columns
    kept = wanted[: max(min(MOST_CURVES, int(allowed // THRESHOLDS.curve_knots)), 0)]
    groups = list(grid)
    for over, coupling in kept:
        low, high = _reach(over, found)
        low = -high if coupling == EACH_WAY else low
        shape: Shape = {"over": over, "coupling": coupling, "low": low, "high": high}
        groups.append(GridGroup(FleetCurve(), shape, tuple(range(THRESHOLDS.curve_knots)), len(kept)))
    return tuple(groups)


def _wanted(found: Sequence[Found]) -> list[tuple[str, str]]:
    """Return covariates and couplings of curves: those that most recordings show first, then the usual ones."""
    shown = Counter(one for each in found for one in dict.fromkeys(_shown_in(each)))
    most = max(len(each.couplings) for each in found)
    usual = [
        (name, each.couplings[place])
        for place in range(most)
        for each in found
        for name in (each.ranges if place < len(each.couplings) else ())
    ]
    everything = [*(one for one, _ in shown.most_common()), *usual]
    return [one for one in dict.fromkeys(everything) if one[0] not in OF_ONE_RECORDING and _varies(one[0], found)]


def _shown_in(found: Found) -> Iterator[tuple[str, str]]:
    """Yield the covariates and couplings of the smooth terms that a recording shows."""
    for term in found.terms:
        if not term.named and term.coupling not in SINES and term.name in found.ranges:
            yield term.name, term.coupling


def _varies(covariate: str, found: Sequence[Found]) -> bool:
    low, high = _reach(covariate, found)
    return high > low


def _reach(covariate: str, found: Sequence[Found]) -> tuple[float, float]:
    """Return from where to where a covariate reaches in all recordings that have it."""
    ranges = [each.ranges[covariate] for each in found if covariate in each.ranges]
    return min(low for low, _ in ranges), max(high for _, high in ranges)
