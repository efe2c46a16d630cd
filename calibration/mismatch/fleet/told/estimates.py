"""The size of an effect or a parameter in each single recording: what a course over dates is seen from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.fleet.choice.recordings import shown_beside
from regolithd.calibration.mismatch.fleet.told.sizes import told_sizes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit
    from regolithd.calibration.mismatch.fleet.work.found import Found
    from regolithd.calibration.mismatch.fleet.work.grid import GridGroup


@dataclass(frozen=True)
class Estimate:
    """The first coefficient of an effect in one recording.

    Attributes
    ----------
    wheels: indices of the wheels that it was estimated from
    acts: whether the effect acts in this recording, as the fleet's fit has it
    value, std: in physical units
    """

    wheels: tuple[int, ...]
    acts: bool
    value: float
    std: float


def estimates_of(equations: FleetEquations, fit: FleetFit, index: int) -> list[tuple[int, Estimate]]:
    """Return the estimates in all recordings of the effect's rovers, before its onset too, with their recordings.

    All else is as the fleet's fit has it; of an effect of several coefficients, all have the same factor. Where the
    wheels have coefficients of their own, each has an estimate.
    """
    term, span, left = fit.terms[index], fit.spans[index], equations.left_moment(fit)
    at, found = list(term.group.columns), list[tuple[int, Estimate]]()
    sizes, factors = fit.coefficients[span].reshape(-1, len(at)), fit.factors[span][:: len(at)]
    for i in equations.of_rovers(term.units.rovers):
        for (rovers, on), size, factor in zip(term.parts, sizes, factors, strict=True):
            wheels = tuple(w for w in on if equations.counts[i, w] > 0)
            energy = sum(float(size @ equations.known(i, w, at) @ size) for w in wheels)
            told = _told_size(term.group, size)
            if equations.rover[i] in rovers and energy > 0 and told:
                by = float(np.max(factor[i]))
                further = _further(left[i][:, at], size, wheels) / energy
                found.append((i, Estimate(wheels, by != 0, told * (by + further), abs(told) / energy**0.5)))
    return found


def _told_size(group: GridGroup, size: np.ndarray) -> float:
    """Return the first parameter of an effect: its first coefficient, or what it makes of those of a wheel."""
    if not group.of_wheels:
        return float(size[0])
    values, _ = told_sizes(group, size, np.zeros(len(size)))
    return next(iter(group.candidate.parameters(group.shape, values.tolist()).values()))


def parameter_alone(
    equations: FleetEquations, fit: FleetFit, found: Sequence[Found], name: str
) -> list[tuple[float, float]]:
    """Return how far a parameter is from its stated value in each recording alone, with its standard deviation.

    Its prior is widened, as where it was stated wrongly; other parameters are each recording's own, within theirs.
    """
    place, count = equations.tangents.index(name), len(equations.tangents)
    released = frozenset(place + count * recording for recording in range(equations.count))
    shown = shown_beside(equations, fit, found).terms
    alone = replace(equations, level="recording", released=released).beside(shown).fit(fit.terms)
    stds = np.sqrt(np.maximum(np.diag(alone.covariance), 0.0))
    return [(float(alone.coefficients[at]), float(stds[at])) for at in sorted(released)]


def _further(left: np.ndarray, size: np.ndarray, wheels: Sequence[int]) -> float:
    """Return the product of an effect and what is left of the residual."""
    return float(sum(left[w] @ size for w in wheels))
