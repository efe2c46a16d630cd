"""The parameters of a fleet whose simulation predicts two channels are those of all readings."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Prior, Simulation, compare

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

TRUE = {"current_per_load": 0.52, "pressure_per_load": 1.97}
NOISE_A, NOISE_PA = 0.05, 0.2


class Pump(Simulation):
    """A current, and a pressure on which both parameters act."""

    channels: ClassVar = {"current_A": "A", "pressure_Pa": "Pa"}
    inputs: ClassVar = ("load",)
    parameters: ClassVar = {
        "current_per_load": Prior(0.5, 0.02, "A"),
        "pressure_per_load": Prior(2.0, 0.05, "Pa"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Mapping[str, Array]:  # type: ignore[override]
        """Return both channels."""
        current = values["current_per_load"] * inputs["load"]
        return {"current_A": current, "pressure_Pa": values["pressure_per_load"] * inputs["load"] - current}


def recording(seed: int) -> dict[str, Array]:
    """Return two minutes."""
    rng, time_s = np.random.default_rng(seed), 0.1 * np.arange(1200)
    load = 2.0 + np.sin(time_s / 7) + 0.5 * np.sin(time_s / 2.3)
    current, pressure = TRUE["current_per_load"] * load, (TRUE["pressure_per_load"] - TRUE["current_per_load"]) * load
    return {
        "t_s": time_s,
        "load": load,
        "current_A": current + rng.normal(0, NOISE_A, len(load)),
        "pressure_Pa": pressure + rng.normal(0, NOISE_PA, len(load)),
    }


def test_each_parameter_is_known_by_all_channels_together() -> None:
    """The pressure knows the difference of the two alone: with what the current knows, it knows both."""
    seeds = range(3, 6)
    answer = compare([recording(seed) for seed in seeds], Pump()).answer
    told = {each.name: each for each in answer.parameters}
    assert told.keys() == TRUE.keys()
    squares = sum(float(np.sum(recording(seed)["load"] ** 2)) for seed in seeds)
    of_current = NOISE_A / squares**0.5
    std = {"current_per_load": of_current, "pressure_per_load": np.hypot(NOISE_PA / squares**0.5, of_current)}
    for name, true in TRUE.items():
        assert told[name].low < true < told[name].high
        assert 0.8 < (told[name].high - told[name].low) / (2 * 1.645 * std[name]) < 2.0
