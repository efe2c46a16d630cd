"""A state's memory is found from its response; what acts on it by a covariate is located over that."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from heated_room import ROWS, TRUE, MEMORY_s, Room, STEP_s, recorded, response

from regolithd.calibration.mismatch import Prior, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.empirical.written import with_curves
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.state.state_memory import before_state, memory_s, through_state

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
    (note,) = [each for each in found.notes if "acts on a state" in each]
    assert re.search(r"acts on a state of the simulation, which shows it for about 3[5-9]00 s", note)
    with pytest.raises(SimulationError, match="acts on a state of the simulation, and no curve over it is fitted"):
        with_curves(found, comparison.evidence)
    assert compare(recorded(seed, error_A=0.0), Room()).answer.verdict == "consistent"


class FromFirstReading(Room):
    """A room whose simulation begins with its first reading."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the temperature: what it began with is forgotten."""
        begun = inputs["room_degC"][0] * np.exp(-inputs["t_s"] / values["memory_s"])
        return super().predict(inputs, values) + begun


@pytest.mark.parametrize(("offset_K", "draught_K", "constant"), [(3.0, 0.0, True), (0.0, 3.0, False)])
def test_an_offset_of_the_readings_is_a_constant_in_the_balance(
    offset_K: float, draught_K: float, *, constant: bool
) -> None:
    """The simulation begins with it and forgets it; a note says that nothing else has to vary."""
    read = recorded(2, draught_K=draught_K, error_A=0.0)
    answer = compare(read.with_channels(room_degC=read.channels["room_degC"] + offset_K), FromFirstReading()).answer
    assert answer.verdict == "unexplained"
    (note,) = [each for each in answer.notes if "acts on a state" in each]
    assert ("so does an offset of the readings of room_degC" in note) == constant


def test_what_acted_on_a_state_is_taken_back_from_what_it_shows() -> None:
    """Means of it, where all readings of a run are there."""
    recording = recorded(3)
    problem = build_problem(recording, Room())
    acting = np.repeat(np.random.default_rng(1).uniform(-1, 1, ROWS // 100), 100)[:, None]
    acted, known = before_state(problem, through_state(problem, acting, MEMORY_s), MEMORY_s)
    length = int(MEMORY_s / STEP_s / 8)
    assert np.flatnonzero(known[:, 0])[:3].tolist() == [2 * length - 1, 3 * length - 1, 4 * length - 1]
    steady = known & (np.arange(ROWS) % 100 >= 2 * length)[:, None]
    np.testing.assert_allclose(acted[steady], acting[steady], atol=0.02)
    assert not before_state(problem, acting[:length], MEMORY_s)[1].any()


def _aired(seed: int, lost_K: float, noise_memory: float = 0.0, times_as_long: float = 1.0) -> Recording:
    """Return a recording of a room whose window is open now and then; noise of 0.5 K, a half of it slow."""
    random = np.random.default_rng(seed)
    current = np.repeat(random.uniform(8, 20, ROWS // 50), 50)
    is_open, rows = np.zeros(ROWS), 0
    while rows < ROWS:
        shut, aired = times_as_long * random.exponential(120), times_as_long * random.uniform(20, 50)
        is_open[int(rows + shut) : int(rows + shut + aired)] = 1
        rows += int(shut + aired)
    slow = np.zeros(ROWS)
    for row in range(1, ROWS):
        slow[row] = noise_memory * slow[row - 1] + np.sqrt(1 - noise_memory**2) * random.normal()
    room = response(current, TRUE, lost_K * is_open) + 0.35 * slow + 0.35 * random.normal(size=ROWS)
    columns = {"t_s": STEP_s * np.arange(ROWS), "heater_A": current, "wind_m_s": np.full(ROWS, 3.0)}
    return from_columns({**columns, "room_degC": room})


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_comes_and_goes_before_a_state_is_unexplained(seed: int) -> None:
    """A window that is opened now and then: the temperature follows slowly, as slow noise does."""
    answer = compare(_aired(seed, 8.0, 0.9), Room()).answer
    assert (answer.verdict, [each.covariate for each in answer.unexplained]) == ("unexplained", ["time"])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_comes_and_goes_a_few_times_is_told_over_time(seed: int) -> None:
    """It is no noise that lasts for long, and follows no other covariate."""
    answer = compare(_aired(seed, 1.5, times_as_long=4.0), Room()).answer
    assert (answer.verdict, [each.covariate for each in answer.unexplained]) == ("unexplained", ["time"])


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("noise_memory", [0.0, 0.9, 0.98])
def test_slow_noise_of_a_state_is_nothing_that_comes_and_goes(seed: int, noise_memory: float) -> None:
    """Also where it is as slow as the state itself."""
    assert compare(_aired(seed, 0.0, noise_memory), Room()).answer.verdict == "consistent"
