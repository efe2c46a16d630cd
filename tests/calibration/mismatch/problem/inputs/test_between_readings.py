"""What an input was between two readings, where it is late by no whole number of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.inputs.between_readings import doubts_by_moved
from regolithd.calibration.mismatch.problem.predictor import complete_inputs

if TYPE_CHECKING:
    from collections.abc import Mapping

COUNT = 900
FINE = 10
"""Values of the true load for each reading."""


class Brake(Simulation):
    """A drive whose current follows the torque of a brake."""

    channel, unit = "current_A", "A"
    inputs = ("load_Nm",)
    parameters = {"share": Prior(0.5, 0.02, "A/(N·m)")}  # noqa: RUF012  # as users write it

    def predict(self, inputs: dict[str, np.ndarray], values: dict[str, float]) -> np.ndarray:
        """Return the current."""
        return values["share"] * inputs["load_Nm"]


def recorded(delay_s: float, seed: int = 1, noise: float = 0.05) -> dict[str, np.ndarray]:
    """Return a recording in which the load steps between the readings, and is read late."""
    random = np.random.default_rng(seed)
    lengths = random.integers(5 * FINE, 40 * FINE, COUNT)
    load = np.repeat(random.uniform(1.0, 20.0, COUNT), lengths)[: COUNT * FINE]
    at = np.arange(COUNT) * FINE
    late = load[np.maximum(at - round(delay_s * FINE), 0)]
    return {
        "t_s": np.arange(float(COUNT)),
        "current_A": 0.5 * load[at] + noise * random.normal(size=COUNT),
        "load_Nm": late,
    }


def test_where_an_input_steps_its_value_on_time_is_in_doubt() -> None:
    """By a part of the step, beside it; elsewhere, and of a delay of whole readings, not at all."""
    recording = from_columns(recorded(0.0))
    simulation = Brake()
    inputs = complete_inputs(recording)
    load = inputs["load_Nm"][:, 0]

    def predict(others: Mapping[str, np.ndarray]) -> np.ndarray:
        return simulation.predict(dict(others), {"share": 0.5})

    assert doubts_by_moved(recording, predict, predict(inputs), {"load_Nm": 3.0}, {}) == []
    (doubt,) = doubts_by_moved(recording, predict, predict(inputs), {"load_Nm": 2.5}, {})
    steps = np.abs(np.append(np.diff(load), 0.0))
    np.testing.assert_allclose(
        np.sqrt(doubt.alone[2:-2, 0])[steps[2:-2] > 0], 0.5 * steps[2:-2][steps[2:-2] > 0] * 0.3536, rtol=1e-3
    )
    far = np.convolve(steps, np.ones(5), "same") == 0
    assert np.all(doubt.alone[far] == 0)
    assert not doubt.bias.any()


@pytest.mark.parametrize(("delay_s", "noise"), [(2.6, 0.05), (5.5, 0.2)])
def test_a_late_input_that_steps_leaves_nothing_unexplained(delay_s: float, noise: float) -> None:
    """Its delay alone is told, although the readings after each step lie between two levels."""
    answer = compare(recorded(delay_s, noise=noise), Brake()).answer
    assert [effect.name for effect in answer.effects] == ["sensor-delay"]
    assert answer.unexplained == ()
    delay = answer.effects[0].parameters["delay_s"]
    assert delay.low < delay_s < delay.high
