"""The smallest effects that a fleet's recordings would have shown together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Sensitivity
from regolithd.calibration.mismatch.fleet.choice.search import may_share, penalty
from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm
from regolithd.calibration.mismatch.inference.uncertainty.sensitivity import LARGEST_TOLD
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from regolithd.calibration.mismatch.fleet.choice.search import Place
    from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit
    from regolithd.calibration.mismatch.fleet.work.grid import GridGroup
    from regolithd.calibration.mismatch.simulation.simulation import Simulation

DETERMINED = 1e-9
"""Share of a term's energy outside of the span of all else, below which that is rounding."""


def sensitivities(
    chooser: Chooser, fit: FleetFit, simulation: Simulation, not_together: Iterable[str]
) -> tuple[Sensitivity, ...]:
    """Return, for each candidate, the smallest root mean square that would have shown, on the first place it may be.

    Of those that are `not_together` looked for it is infinite.
    """
    found = dict.fromkeys(not_together, float("inf"))
    for group in chooser.equations.named_groups:
        place = _first_place(chooser, group)
        if place is None:
            found.setdefault(group.candidate.name, float("inf"))
            continue
        term = FleetTerm(group, place.units, place.courses(group)[0])
        others = [each for each in fit.terms if each.name != term.name]
        found.setdefault(term.name, _smallest(chooser, others, term))
    return tuple(Sensitivity(name, simulation.channel, size, simulation.unit) for name, size in sorted(found.items()))


def _first_place(chooser: Chooser, group: GridGroup) -> Place | None:
    """Return the first place that a candidate may have: all rovers, where all wheels may have it, else of one rover."""
    return next(
        (
            place
            for place in chooser.places
            if may_share(group, place.units, len(chooser.equations.wheels))
            and place.courses(group)
            and ("all" in group.candidate.sharing or len(place.units.rovers) == 1)
        ),
        None,
    )


def _smallest(chooser: Chooser, others: Sequence[FleetTerm], term: FleetTerm) -> float:
    """Return the smallest root mean square where a term acts; of sizes of its own each part has the same.

    Infinite: none shows, or only one of many times the mean reading.
    """
    equations = chooser.equations
    fit = equations.fit((*others, term))
    at, span, factors = list(term.group.columns), fit.spans[-1], equations.factors(term)
    variances = np.maximum(np.diag(fit.covariance)[span].reshape(-1, len(at)).max(axis=1), 1e-300)
    energies = np.diagonal(equations.gram, axis1=2, axis2=3)[:, :, at] * equations.reductions[:, None, at]
    acts = np.einsum("piw,iwc->pc", factors**2, energies).max(axis=1)
    told = 1 / variances > DETERMINED * acts
    if not told.any():
        return float("inf")
    squares = sum(
        float(np.max(factors[:, i, w]) ** 2 * equations.products(int(i), int(w), at[:1])[0, 0])
        for i, w in zip(*np.nonzero(factors.any(axis=0)), strict=True)
    )
    readings = float(equations.counts[factors.any(axis=0)].sum())
    needed = np.sqrt(chooser.entry_threshold + penalty(equations, term)) + THRESHOLDS.detection_quantile
    size = float(np.mean([sums.mean_size for sums in equations.sums]))
    outside = float(np.sum(1 / variances[told]))
    found = max(
        float(np.sqrt(squares / max(readings, 1.0)) * needed / np.sqrt(outside)), THRESHOLDS.smallest_effect * size
    )
    return found if found <= LARGEST_TOLD * size else float("inf")
