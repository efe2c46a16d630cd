"""An effect beside which a parameter leaves its prior is none."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import CANDIDATES, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch import Candidate, Coefficient, Problem, Shape
from regolithd.calibration.mismatch.selection.decision import decide
from regolithd.calibration.mismatch.selection.plausibility.pulled_parameters import drop_what_pulls_parameters_out

if TYPE_CHECKING:
    from numpy.typing import NDArray


def wave(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what no parameter and no other candidate can follow."""
    return np.sin(2 * np.pi * time_s / 7.3)


class AlmostTheLevel(Candidate):
    """What acts as the parameter `level` does, but for a small part."""

    name, covariate, equation, words, signature = "almost-level", "none", "ΔV = c (1 + s/20)", "a level", "a level"
    experiment, source = "wait", "test"
    coefficients: ClassVar = (Coefficient("level", "{unit}", 0),)

    def columns(self, problem: Problem, shape: Shape) -> NDArray[np.float64]:  # noqa: ARG002
        """Return 1 with a small wave."""
        return np.broadcast_to(1 + 0.05 * wave(problem.time_s), problem.mask.shape)[None]


def waving(size: float) -> dict[str, NDArray[np.float64]]:
    """Return a recording with a drag and a wave."""
    columns = table(drag=0.4)
    return {**columns, "reading_V": columns["reading_V"] + size * wave(columns["t_s"])}


def test_an_effect_that_cancels_a_parameter_is_dropped() -> None:
    """Of a level 4 V too high and an effect 4 V too low the wave would be left; a drag beside it stays."""
    equations = equations_of(problem_of(waving(0.2)), (*CANDIDATES, AlmostTheLevel()))
    drag, almost = term_of(equations, "drag"), term_of(equations, "almost-level")
    pulled = equations.fit((drag, almost))
    assert pulled.delta_chi2 > equations.fit((drag,)).delta_chi2 + 100
    assert drop_what_pulls_parameters_out(equations, pulled).terms == (drag,)
    assert "almost-level" not in {term.name for term in decide(equations, CANDIDATES).named.terms}


@pytest.mark.parametrize("off", [0.0, 5.0])
def test_a_parameter_that_is_outside_anyway_condemns_no_effect(off: float) -> None:
    """A level that was stated wrongly is a finding of its own."""
    columns = table(drag=0.4)
    columns["reading_V"] = columns["reading_V"] + off
    equations = equations_of(problem_of(columns))
    named = equations.fit([term_of(equations, "drag")])
    assert drop_what_pulls_parameters_out(equations, named) is named
