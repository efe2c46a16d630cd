"""A curve that the recordings of a fleet have in common, as it is told."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.empirical.found import with_band
from regolithd.calibration.mismatch.fleet.choice.selection import without
from regolithd.calibration.mismatch.fleet.told.answer import FleetUnexplained
from regolithd.calibration.mismatch.fleet.told.sizes import rms, told_sizes
from regolithd.calibration.mismatch.problem.words import unit_in_label
from regolithd.calibration.mismatch.regression.groups.state_groups import ON_STATE

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.fleet.choice.held_out import HeldOutSquares
    from regolithd.calibration.mismatch.fleet.told.chosen import Beside, Chosen
    from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve


def curve_in_common(chosen: Chosen, index: int, beside: Beside, held_out: HeldOutSquares) -> FleetUnexplained:
    """Return a curve that recordings have in common, and how much of what they leave it is, beyond chance."""
    equations, fit, names = chosen.equations, chosen.fit, chosen.names
    term = fit.terms[index]
    acting = equations.factors(term).any(axis=0) & (equations.counts > 0)
    date, counts = names.date(term.course.first), equations.counts[acting]
    errors = rms(held_out.without[index][acting], counts), rms(held_out.after[acting], counts)
    left, less = (equations.squares(each)[acting].sum() for each in (fit, equations.fit(without(fit, index))))
    at = np.flatnonzero(acting.any(axis=1)).tolist()
    return FleetUnexplained(
        channel=chosen.simulation.channel,
        wheels=tuple(equations.wheels[w] for w in term.units.wheels if acting[:, w].any()),
        covariate=str(term.group.shape["over"]),
        from_s=min(chosen.found[i].first_s for i in at),
        to_s=max(chosen.found[i].last_s for i in at),
        share_of_residual=float(np.clip((less - left) / max(less, 1e-300), 0.0, 1.0)),
        rovers=tuple(names.rovers[rover] for rover in term.units.rovers),
        recordings=tuple(names.recordings[i] for i in at),
        since=date if term.course.kind == "since" else None,
        until=date if term.course.kind == "until" else None,
        curve=_empirical(chosen, index, beside, errors),
    )


def _empirical(chosen: Chosen, index: int, beside: Beside, errors: tuple[float, float]) -> EmpiricalCurve | None:
    """Return a curve with its band at the knots that its recordings reach; None where it acts on a state.

    Of a curve of each rover's own it is the mean of these with their spread.
    """
    term, span = beside.fit.terms[index], beside.fit.spans[index]
    over, coupling = str(term.group.shape["over"]), str(term.group.shape["coupling"])
    value, std = told_sizes(term.group, beside.fit.coefficients[span], beside.stds[span])
    known = np.flatnonzero(std > 0)
    if coupling == ON_STATE or not known.size:
        return None
    reached = slice(known[0], known[-1] + 1)
    at = np.linspace(float(term.group.shape["low"]), float(term.group.shape["high"]), len(value))
    units = chosen.simulation.unit, unit_in_label(over, chosen.labels)
    return with_band(over, coupling, units, (at[reached], value[reached], std[reached]), errors)
