"""Groups of candidates: each candidate's columns in each shape, with their penalties."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.candidates.late_columns import columns_of
from regolithd.calibration.mismatch.regression.group import Group

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix


def coefficient_signs(candidate: Candidate, count: int) -> tuple[int, ...]:
    """Return the sign of each of `count` columns; columns beyond the declared coefficients may have either."""
    declared = tuple(coefficient.sign for coefficient in candidate.coefficients[:count])
    return declared + (0,) * (count - len(declared))


def of_grid(problem: Problem, groups: Sequence[Group]) -> Sequence[Group]:
    """Return those groups of one candidate whose shape is of its grid, or all where none is.

    Which there are between the points of the grid depends on what was searched for before.
    """
    candidate = groups[0].candidate
    grid = candidate.shapes(problem) if candidate else ()
    return [group for group in groups if group.shape in grid] or groups


def implausibility(problem: Problem, candidate: Candidate, shape: Shape) -> float:
    """Return the Δχ² that a candidate must gain for being hardly possible on this machine, or in this shape.

    Beside effects that the simulation was corrected by, what is new is charged: that these changed is more likely. So
    is each number that is no usual one, as much as it had to gain.
    """
    unlikely = candidate.name in problem.simulation.unlikely_effects
    new = bool(problem.stated) and not candidate.stated_size
    charged = problem.thresholds.unlikely_penalty * unlikely + problem.thresholds.new_effect_penalty * new
    return candidate.prior_penalty(problem, shape) + charged + cost_of_unusual_numbers(problem, candidate, shape)


def cost_of_unusual_numbers(problem: Problem, candidate: Candidate, shape: Shape) -> float:
    """Return the Δχ² that a shape has to gain for its numbers that are no usual ones."""
    return problem.thresholds.lead_margin * len(candidate.unusual(problem, shape))


def with_candidate(
    design: DesignMatrix, candidate: Candidate, shapes: Sequence[Shape], noise_reductions: Sequence[float] = ()
) -> tuple[DesignMatrix, tuple[Group, ...]]:
    """Return the design matrix with a candidate in each of these shapes, and the new groups.

    `noise_reductions` is how much less noise there is at the frequencies of each shape than in the long run.
    """
    problem, groups = design.problem, []
    selected_from_many = 2 * float(np.log(candidate.shape_count(problem)))
    for shape, reduction in zip(shapes, noise_reductions or [1.0] * len(shapes), strict=True):
        found = columns_of(problem, candidate, shape)
        design, places = design.extended(list(found))
        groups.append(
            Group(
                name=candidate.name,
                columns=places,
                signs=coefficient_signs(candidate, len(found)),
                sharing=candidate.sharing,
                selection_penalty=selected_from_many + implausibility(problem, candidate, shape),
                candidate=candidate,
                shape=shape,
                noise_reduction=reduction,
                own_channel=candidate.own_channel_evidence(problem, shape),
                acting=np.any(np.where(problem.mask, found, 0.0) != 0, axis=1) if len(found) > 1 else None,
            )
        )
    return design.with_groups((*design.groups, *groups)), tuple(groups)


def with_candidates(
    design: DesignMatrix, candidates: Sequence[Candidate]
) -> tuple[DesignMatrix, tuple[Candidate, ...]]:
    """Return the design matrix with every candidate that this recording allows, in its grid of shapes; and those."""
    applicable = tuple(candidate for candidate in candidates if candidate.applies(design.problem))
    for candidate in applicable:
        design, _ = with_candidate(design, candidate, candidate.shapes(design.problem))
    return design, applicable
