"""Sensitivity: for every candidate, the smallest effect that this recording would have shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Sensitivity
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.groups.candidate_groups import of_grid
from regolithd.calibration.mismatch.regression.penalties import full_penalty
from regolithd.calibration.mismatch.regression.residuals import active_rms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


LARGEST_TOLD = 1.0
"""Size over the mean reading beyond which an effect does not show, however large (a choice: nobody overlooks one as
large as what is read)."""


def sensitivities(
    equations: NormalEquations, given: Fit, candidates: Sequence[Candidate], entry_threshold: float
) -> tuple[Sensitivity, ...]:
    """Return root mean squares on the wheels concerned, in the channel's unit, beside the effects of the fit."""
    channel, unit = equations.problem.simulation.channel, equations.problem.simulation.unit
    found = []
    for candidate in candidates:
        law = candidate.name, candidate.stated_size > 0
        groups = [group for group in equations.design.groups if group.law == law and group.named]
        if not groups:
            found.append(Sensitivity(candidate.name, channel, float("inf"), unit))
            continue
        # A shape in the middle of the grid stands for the family.
        on_grid = of_grid(equations.problem, groups)
        group = on_grid[len(on_grid) // 2]
        wheels = equations.all_wheels
        patterns = [wheels] if "all" in candidate.sharing or len(wheels) == 1 else [(w,) for w in wheels]
        # What was found already is looked for anew, not beside itself.
        others = [term for term in given.terms if term.name != candidate.name]
        sizes = [smallest_detectable(equations, others, Term(group, on), entry_threshold) for on in patterns]
        # A change is seen on the wheels that have the effect, and on no other.
        size = min(sizes) if group.is_change else float(np.median(sizes))
        found.append(Sensitivity(candidate.name, channel, size, unit))
    return tuple(sorted(found, key=lambda one: one.name))


def smallest_detectable(equations: NormalEquations, given: Sequence[Term], term: Term, entry_threshold: float) -> float:
    """Return the root mean square whose Δχ² passes the entry threshold nine times in ten.

    Infinite: none does, or only one of many times the mean reading.
    """
    problem, design, limits = equations.problem, equations.design, equations.thresholds
    own, complement = equations.own_and_complement(given, term)
    total = float(np.trace(own)) / len(own)
    penalty = full_penalty(term, len(equations.weights), limits)
    needed = (np.sqrt(entry_threshold + penalty) + limits.detection_quantile) ** 2 / term.group.noise_reduction
    outside = float(np.max(np.linalg.eigvalsh(complement)))
    if outside <= 1e-9 * total:
        return float("inf")
    on = list(term.wheels)
    known = problem.mask.T[:, design.order][on]
    columns = design.columns_as_read(term.group.columns)[:, on].astype(np.float64)
    squares = np.mean(columns**2, axis=0)[known]
    rms = float(np.sqrt(np.mean(squares)))
    least = limits.smallest_effect * problem.mean_size / active_rms(squares, limits.active_share)
    found = rms * max(float(np.sqrt(needed / outside)), least)
    return found if found <= LARGEST_TOLD * problem.mean_size else float("inf")
