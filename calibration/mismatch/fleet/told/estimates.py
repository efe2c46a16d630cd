"""The size of an effect or a parameter in each single recording: what a course over dates is seen from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.fleet.choice.recordings import shown_beside

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations, FleetFit
    from regolithd.calibration.mismatch.fleet.work.found import Found


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


def estimates_of(equations: FleetEquations, fit: FleetFit, index: int) -> dict[int, Estimate]:
    """Return the estimates in all recordings of the effect's rovers, before its onset too, by recording.

    All else is as the fleet's fit has it; of an effect of several coefficients, all have the same factor.
    """
    term, span, left = fit.terms[index], fit.spans[index], equations.left_moment(fit)
    at, found = list(term.group.columns), {}
    sizes, factors = fit.coefficients[span].reshape(-1, len(at)), fit.factors[span][:: len(at)]
    for i in equations.of_rovers(term.units.rovers):
        wheels = tuple(w for w in term.units.wheels if equations.counts[i, w] > 0)
        own = [k for k in range(len(sizes)) if factors[k, i].any()] or [0]
        size, factor = sizes[own[0]], float(np.max(factors[own[0], i]))
        energy = sum(float(size @ equations.gram[i, w][np.ix_(at, at)] @ size) for w in wheels)
        if energy <= 0 or size[0] == 0:
            continue
        further = _further(left[i][:, at], size, wheels) / energy
        found[i] = Estimate(wheels, factor != 0, float(size[0]) * (factor + further), abs(float(size[0])) / energy**0.5)
    return found


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
