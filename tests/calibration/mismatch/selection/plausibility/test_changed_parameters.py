"""A fault of one wheel against a parameter of the simulation that changes."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import CANDIDATES, STEP_S, Step, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch.selection.plausibility.changed_parameters import (
    drop_what_a_changed_parameter_explains,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch import Problem, Shape

ONSET_S = 160.0


class Fault(Step):
    """A step of one axis."""

    name = "fault"
    sharing: ClassVar = ("one",)

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002
        """One onset."""
        return [{"onset_s": ONSET_S, "rise_s": 0.0}]


@pytest.mark.parametrize(("axes", "kept"), [((1.0,), True), ((1.0, 2.0), False)])
def test_what_all_axes_show_as_the_parameter_does_is_no_fault_of_one(axes: tuple[float, ...], kept: bool) -> None:
    """A step of one reading is its fault; one of both is the level's, though it was named on one axis."""
    columns = table()
    later = (columns["t_s"] >= ONSET_S - STEP_S / 2) & np.isin(columns["axis"], axes)
    columns["reading_V"] = columns["reading_V"] + 0.3 * later
    equations = equations_of(problem_of(columns), (*CANDIDATES, Fault()))
    named = equations.fit([term_of(equations, "fault", wheels=(0,))])
    assert bool(drop_what_a_changed_parameter_explains(equations, named).terms) is kept


@pytest.mark.parametrize(("share", "kept"), [(0.487, True), (0.5, False)])
def test_a_lead_within_the_misfit_of_laws_is_none(share: float, kept: bool) -> None:
    """Of a step on both axes the change of the level explains 0.5 % and 4 % more than the fault of the first."""
    columns = table()
    size = np.where(columns["axis"] == 1.0, 3.0, 3.0 * share)
    columns["reading_V"] = columns["reading_V"] + size * (columns["t_s"] >= ONSET_S - STEP_S / 2)
    equations = equations_of(problem_of(columns), (*CANDIDATES, Fault()))
    named = equations.fit([term_of(equations, "fault", wheels=(0,))])
    assert bool(drop_what_a_changed_parameter_explains(equations, named).terms) is kept


def test_effects_of_all_axes_are_left_alone() -> None:
    """They may be changes of parameters themselves, as of the soil."""
    columns = table()
    columns["reading_V"] = columns["reading_V"] + 0.3 * (columns["t_s"] > ONSET_S)
    equations = equations_of(problem_of(columns))
    named = equations.fit([term_of(equations, "step", place=3)])
    assert drop_what_a_changed_parameter_explains(equations, named) is named


class Wavy(Fault):
    """A step with a wave of a share of its size."""

    name = "wavy"

    def __init__(self, wave: float) -> None:
        self._wave = wave

    def columns(self, problem: Problem, shape: Shape) -> NDArray[np.float64]:
        """Return the step with its wave."""
        return np.asarray(super().columns(problem, shape) * (1 + self._wave * np.sin(problem.time_s / 3)))


@pytest.mark.parametrize(("wave", "kept"), [(0.17, True), (0.35, False)])
def test_a_parameter_that_is_the_effect_itself_is_no_other_explanation(wave: float, kept: bool) -> None:
    """On one axis a level that changes is an offset that begins, but where the two have another course."""
    columns = {name: values[::2] for name, values in table().items()}
    columns["reading_V"] = columns["reading_V"] + 3.0 * (columns["t_s"] >= ONSET_S - STEP_S / 2)
    fault = Wavy(wave)
    equations = equations_of(problem_of(columns), (*CANDIDATES, fault))
    named = equations.fit([term_of(equations, "wavy", wheels=(0,))])
    assert bool(drop_what_a_changed_parameter_explains(equations, named).terms) is kept
