"""A law that follows a part of what cannot be named gets no name in its place."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import CANDIDATES, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch import Candidate, Coefficient, Problem, Shape
from regolithd.calibration.mismatch.selection.plausibility.implausible_effects import drop_what_the_implausible_explains

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class Impossible(Candidate):
    """A drag with a part of its own, of which no size below 9 V is possible."""

    name, covariate, equation, words, signature = "impossible", "none", "ΔV = c (sign(ω) + s)", "a drag", "a sign"
    experiment, source = "drive both ways", "test"
    coefficients: ClassVar = (Coefficient("size", "{unit}"),)

    def columns(self, problem: Problem, shape: Shape) -> NDArray[np.float64]:  # noqa: ARG002
        """Return a sign and a quick wave."""
        return (problem.covariates["direction"] + 1.5 * wave(problem.time_s))[None]

    def plausible(self, problem: Problem, shape: Shape, values: Sequence[float]) -> bool:  # noqa: ARG002
        """Return whether it is large."""
        return values[0] > 9


def wave(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a wave that no other candidate follows."""
    return np.sin(2 * np.pi * time_s / 7.3)


@pytest.mark.parametrize(("drag", "kept"), [(0.2, ()), (0.7, ("drag",))])
def test_a_drag_that_is_a_part_of_it_loses_its_name(drag: float, kept: tuple[str, ...]) -> None:
    """What is there beside the impossible has its name: half a volt more than the impossible's 0.2 V."""
    columns = table(drag=drag)
    columns["reading_V"] = columns["reading_V"] + 0.3 * wave(columns["t_s"])
    equations = equations_of(problem_of(columns), (*CANDIDATES, Impossible()))
    named = equations.fit([term_of(equations, "drag")])
    found = drop_what_the_implausible_explains(equations, named, 8.0)
    assert tuple(term.name for term in found.terms) == kept
