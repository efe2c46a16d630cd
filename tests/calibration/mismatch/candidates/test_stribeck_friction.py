"""Stribeck friction is found by its name alone, however far up the speeds it decays."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROWS = 3000


class Hoist(Simulation):
    """Current of a hoist: in proportion to the pull."""

    channel, unit = "current_A", "A"
    inputs = ("pull_N", "rope_speed_m_s")
    parameters: ClassVar = {"gain_A_N": Prior(0.02, 0.0004, "A/N")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current that the pull needs."""
        return values["gain_A_N"] * inputs["pull_N"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and time."""
        return {"wheel_speed": inputs["rope_speed_m_s"], "time": inputs["t_s"]}


@pytest.mark.parametrize("decay_m_s", [0.45, 0.7])
def test_drag_that_decays_above_the_median_speed_is_stribeck_friction_alone(decay_m_s: float) -> None:
    """No constant drag beside it makes up for a range that ends too soon; the size holds the truth."""
    generator = np.random.default_rng(3)
    phase = np.arange(ROWS) / 40
    speed = np.sin(phase) + 0.5 * np.sin(2.7 * phase)
    extra = 0.4 * np.sign(speed) * np.exp(-((speed / decay_m_s) ** 2))
    pull = 40 + 15 * np.sin(phase / 3)
    current = 0.02 * pull + extra + generator.normal(0, 0.15, ROWS)
    columns = {"t_s": 0.5 * np.arange(ROWS), "current_A": current, "pull_N": pull, "rope_speed_m_s": speed}
    answer = compare(from_columns(columns), Hoist()).answer
    (effect,) = answer.effects
    assert effect.name == "stribeck-friction"
    size = effect.parameters["relative_size"]
    assert size.low < np.sqrt(np.mean(extra**2)) / np.mean(np.abs(current)) < size.high
    decay = effect.parameters["stribeck_speed_rad_s"]
    assert decay.low < decay.value < decay.high
    assert decay.unit == "m/s"


def test_a_constant_drag_beside_one_that_decays_is_no_law_of_another_exponent() -> None:
    """One stretched exponential explains all but a hundredth of both, and has as many numbers as they have together."""
    generator = np.random.default_rng(5)
    phase = np.arange(ROWS) / 40
    speed = 4 * np.sin(phase) + 2 * np.sin(2.7 * phase)
    drag = np.sign(speed) * (0.4 + 0.86 * np.exp(-np.abs(speed) / 1.3))
    pull = 40 + 15 * np.sin(phase / 3)
    current = 0.02 * pull + drag + generator.normal(0, 0.1, ROWS)
    columns = {"t_s": 0.5 * np.arange(ROWS), "current_A": current, "pull_N": pull, "rope_speed_m_s": speed}
    answer = compare(from_columns(columns), Hoist()).answer
    assert sorted(effect.name for effect in answer.effects) == ["coulomb-friction", "stribeck-friction"]
    assert answer.fit.held_out_rmse_after < 1.02 * answer.fit.noise_floor_rmse
