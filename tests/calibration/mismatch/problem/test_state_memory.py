"""A state's memory is found from its response; what acts on it by a covariate is located over that."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from heated_room import MEMORY_s, Room, STEP_s, recorded

from regolithd.calibration.mismatch import Prior, compare
from regolithd.calibration.mismatch.empirical.written import with_curves
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.state_memory import memory_s, through_state

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Static(Room):
    """A room that has no memory."""

    parameters: ClassVar = {"warmth_K_A2": Prior(0.04, 0.004, "K/A²")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the settled temperature."""
        return values["warmth_K_A2"] * inputs["heater_A"] ** 2


class Differentiating(Static):
    """What follows how the current changes: no state either."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the slope of the current, and a part of itself."""
        current = inputs["heater_A"]
        return values["warmth_K_A2"] * (current + 60 * np.gradient(current, axis=0))


def test_the_memory_of_a_state_is_its_time_constant() -> None:
    """Of the room an hour; of what has no state none, also where readings beside each other are differentiated."""
    recording = recorded(1)
    assert memory_s(build_problem(recording, Room())) == pytest.approx(MEMORY_s, rel=0.1)
    assert memory_s(build_problem(recording, Static())) == 0
    assert memory_s(build_problem(recording, Differentiating())) == 0


def test_what_acts_on_a_state_shows_as_a_filter_of_gain_one() -> None:
    """A step is there to 63 % after the memory, and a new run begins anew."""
    recording = recorded(1)
    problem = build_problem(recording, Room())
    shown = through_state(problem, np.ones(problem.mask.shape), MEMORY_s)
    after = int(MEMORY_s / STEP_s)
    assert shown[after, 0] == pytest.approx(1 - np.exp(-1), abs=0.01)
    assert shown[-1, 0] == pytest.approx(1.0)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_draught_is_located_over_the_wind(seed: int) -> None:
    """It acts on the room's heat balance, and a curve that acts on the reading itself would not be found."""
    comparison = compare(recorded(seed, draught_K=1.5, error_A=0.0), Room())
    found = comparison.answer
    assert found.verdict == "unexplained"
    assert [place.covariate for place in found.unexplained] == ["wind"]
    (note,) = found.notes
    assert re.search(r"acts on a state of the simulation, which shows it for about 3[5-9]00 s", note)
    with pytest.raises(SimulationError, match="acts on a state of the simulation, and no curve over it is fitted"):
        with_curves(found, comparison.evidence)
    assert compare(recorded(seed, error_A=0.0), Room()).answer.verdict == "consistent"
