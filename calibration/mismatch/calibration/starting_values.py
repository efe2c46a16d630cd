"""Starting values: where the fit of the parameters begins if tangents at the stated ones do not lead to it.

A parameter that is stated as 0 ± 2 has no value yet. There a product has no tangent, an exponential or a saturation has
a misleading one, and the residual is nearly all misfit, so that the noise seems large. A simulation that switches may
fit best, near by, where it does so at the wrong readings. So the sum of squares of the simulation itself is searched
from several places of the prior (multi-start; `calibration.search`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.calibration.search import AS_WELL, Search
from regolithd.calibration.mismatch.calibration.step import Step
from regolithd.calibration.mismatch.inference.statements import after_number

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.problem.prior import Prior
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

DRAWS = 32
"""Places of the prior at which the simulation is run (a choice: five parameters, each above or below its stated value).
"""
ASKED = 4
"""Of these, places at which the tangents at the stated values are compared with the simulation (a choice)."""
SEARCHES = 4
"""Searches from the best of those places, beside the one from the stated values (a choice of cost)."""


@dataclass(frozen=True, eq=False)
class Start:
    """Where the fit begins.

    Attributes
    ----------
    problem: at the stated values
    values: the parameters'; None: the stated ones
    others: further values that fit the recording as well
    """

    problem: Problem
    values: Mapping[str, float] | None = None
    others: tuple[Mapping[str, float], ...] = ()

    def notes(self, problem: Problem, added: Array) -> tuple[str, ...]:
        """Return what to tell of other values that fit as well, beside what was found.

        `problem` is linearised where that was, and `added` is what it adds to the prediction, shape (time, wheel).
        """
        search = Search.of(replace(problem, measured=problem.measured - added))
        with np.errstate(all="ignore"):
            found = [search.minimum(search.place(values)) for values in (problem.values, *self.others)]
            (least, _), *_ = found
            kept = [place for objective, place in search.apart(found)[1:] if abs(objective - least) < AS_WELL]
        priors = problem.simulation.parameters
        return tuple(
            f"Other values of the parameters fit the recording as well: {_listed(search.values(place), priors)}. A "
            f"narrower prior of one of them tells which are meant."
            for place in kept
        )


def starting_values(problem: Problem) -> Start:
    """Return the parameters' values where the simulation itself fits best.

    They are the stated ones where no parameter is as good as unknown and nothing switches, and where the tangents hold
    all over the prior.
    """
    search = Search.of(problem)
    if not (search.is_wide or search.switches):
        return Start(problem)
    places = _drawn(search)
    steps = [Step(problem, search.values(place)) for place in places[:ASKED]]
    if not any(step.is_bent() or not step.is_defined for step in steps):
        return Start(problem)
    with np.errstate(all="ignore"):  # a prediction may overflow on the way
        ranked = sorted(places, key=lambda place: search.objective(search.left(place), place))
        begun = (np.zeros(len(search.names)), *ranked[:SEARCHES])
        found = sorted((search.minimum(place) for place in begun), key=lambda one: one[0])
        best, *others = [place for objective, place in search.apart(found) if objective - found[0][0] < AS_WELL]
    return Start(problem, search.values(best), tuple(search.values(place) for place in others))


def _drawn(search: Search) -> list[Array]:
    """Return places that fill the prior evenly (Sobol, 1967), always the same ones."""
    # Importing it takes half a second, which a simulation with known parameters need not wait.
    from scipy.stats import qmc  # noqa: PLC0415

    uniform = qmc.Sobol(len(search.names), scramble=False).random(2 * DRAWS)[1 : DRAWS + 1]
    normal = np.vectorize(NormalDist().inv_cdf)(uniform)
    return [search.within(place) for place in normal]


def _listed(values: Mapping[str, float], priors: Mapping[str, Prior]) -> str:
    """Return parameters with their values and units."""
    free = {name: value for name, value in values.items() if priors[name].std > 0 and priors[name].told}
    return ", ".join(f"{name} {value:.4g}{after_number(priors[name].unit)}" for name, value in free.items())
