"""The state with which a run begins is known as well as a reading; what is further off is evidence."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import problem_of, table
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.state.initial_states import initial_states

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]
ROWS, FORGETS_S, NOISE_K = 3000, 60.0, 0.3


class Block(Simulation):
    """A heated block that begins with what was read of it as each run began."""

    channel, unit = "rise_K", "K"
    inputs: ClassVar = ("power_W", "start_K")
    parameters: ClassVar = {"resistance_K_W": Prior(0.2, 0.01, "K/W")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the state of first order."""
        steady, run = values["resistance_K_W"] * inputs["power_W"], inputs["run"]
        found, kept = np.array(inputs["start_K"]), np.exp(-1 / FORGETS_S)
        for row in range(1, len(found)):
            if run[row, 0] == run[row - 1, 0]:
                found[row] = steady[row - 1] + (found[row - 1] - steady[row - 1]) * kept
        return found

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the power."""
        return {"power": inputs["power_W"]}


def recorded(seed: int, runs: int, off_K: float) -> Recording:
    """Return runs whose starts were read with an error of this standard deviation."""
    random, run = np.random.default_rng(seed), np.arange(ROWS) * runs // ROWS
    power = np.concatenate([np.full(rows, random.uniform(50, 250)) for rows in random.integers(40, 150, size=75)])[
        :ROWS
    ]
    start = random.uniform(10, 50, runs)[run]
    inputs = {"power_W": power[:, None], "run": run[:, None].astype(float), "start_K": start[:, None]}
    rise = Block().predict(inputs, {"resistance_K_W": 0.203})[:, 0] + random.normal(0, NOISE_K, ROWS)
    read = start + (off_K * random.choice([-1.0, 1.0], runs))[run]
    return from_columns({"t_s": np.arange(ROWS) * 1.0, "run": run, "power_W": power, "rise_K": rise, "start_K": read})


@pytest.mark.parametrize("runs", [1, 4, 10])
def test_a_start_that_was_read_with_noise_is_consistent(runs: int) -> None:
    """It is off by the noise of a reading for as long as the state remembers."""
    answer = compare(recorded(2, runs, NOISE_K), Block()).answer
    assert answer.verdict == "consistent"
    assert not any("initial state" in note for note in answer.notes)
    (parameter,) = answer.parameters
    assert parameter.low < 0.203 < parameter.high


def test_a_start_that_is_further_off_is_unexplained_with_a_note() -> None:
    """Ten times the noise is no noise: the note says where it begins, and for how long it shows."""
    answer = compare(recorded(3, 4, 10 * NOISE_K), Block()).answer
    assert answer.verdict == "unexplained"
    assert answer.effects == ()
    (place,) = answer.unexplained
    assert (place.covariate, place.from_s) == ("time", 0.0)
    assert 2250 < place.to_s < 2250 + 4 * FORGETS_S
    assert 0.3 < place.share_of_residual < 1
    (note,) = [note for note in answer.notes if "initial state" in note]
    assert note.startswith("As runs 0, 1, 2 and 3 begin, rise_K is off")
    assert "for about 60 s" in note


def test_each_run_has_one_of_each_wheel() -> None:
    """It decays from one standard deviation of a reading's noise."""
    problem = build_problem(recorded(4, 4, 0.0), Block())
    states = list(initial_states(problem))
    assert [(state.run, state.wheel) for state in states] == [(run, 0) for run in range(4)]
    column, rows = states[1].column[:, 0], problem.recording.runs[1]
    assert states[1].rows == rows
    assert column[rows.start] == pytest.approx(NOISE_K, rel=0.1)
    assert column[rows.start + 60] == pytest.approx(column[rows.start] / np.e, rel=0.05)
    assert not column[: rows.start].any()
    assert not column[rows.stop :].any()
    assert not list(initial_states(build_problem(recorded(4, 30, 0.0), Block()))), "too many runs"
    assert not list(initial_states(problem_of(table()))), "a simulation without a state"
