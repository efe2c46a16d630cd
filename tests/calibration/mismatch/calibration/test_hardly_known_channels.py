"""Two channels whose parameters are hardly known: one has products of what the other knows."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer

    Array = NDArray[np.float64]

TRUTH = {"shut_off": 0.0012, "droop": 0.9, "idle_A": 0.8, "per_W": 0.021, "viscous_A_s": 0.011}
INSTANTS, STEP_S, NOISE = 4000, 0.5, 0.02


class Pump(Simulation):
    """A centrifugal pump: its head, and the current for its power, of which neither factor is known alone."""

    channels: ClassVar = {"head_m": "m", "current_A": "A"}
    inputs = ("speed_rad_s", "flow_L_s")
    parameters: ClassVar = {
        "shut_off": Prior(0.0, 0.01, "m s²"),
        "droop": Prior(0.0, 3.0, "m s²/L²"),
        "idle_A": Prior(0.0, 3.0, "A"),
        "per_W": Prior(0.0, 0.05, "A/W"),
        "viscous_A_s": Prior(0.0, 0.05, "A s"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Mapping[str, Array]:  # type: ignore[override]
        """Return head [m] and current [A]."""
        speed, flow = inputs["speed_rad_s"], inputs["flow_L_s"]
        head = values["shut_off"] * speed**2 - values["droop"] * flow**2
        current = values["idle_A"] + values["viscous_A_s"] * speed + values["per_W"] * 9.81 * flow * head
        return {"head_m": head, "current_A": current}

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and flow."""
        return {"wheel_speed": inputs["speed_rad_s"], "flow": inputs["flow_L_s"]}


def answer_to(seed: int, worn_A: float = 0.0) -> Answer:
    """Compare with a pump whose bearing is worn by so much at the end, from the middle on."""
    random = np.random.default_rng(seed)
    time_s = np.arange(INSTANTS) * STEP_S

    def course(period_s: float) -> Array:
        phases = random.uniform(0, 2 * np.pi, 4)
        waves = (np.sin(2 * np.pi * time_s / period_s * k**1.3 + phase) / k for k, phase in enumerate(phases, 1))
        return sum(waves, np.zeros(INSTANTS))

    inputs = {"speed_rad_s": 140 + 35 * course(120), "flow_L_s": np.clip(2.2 + 0.7 * course(77), 0.2, None)}
    true = Pump().predict(inputs, TRUTH)
    worn = worn_A * np.clip(2 * time_s / time_s[-1] - 1, 0, None)
    read = {}
    for channel, values in (("head_m", true["head_m"]), ("current_A", true["current_A"] + worn)):
        noise = np.convolve(random.normal(size=INSTANTS + 8), np.exp(-np.arange(9) / 2), "valid")
        read[channel] = values + NOISE * np.abs(values).mean() * noise / noise.std()
    return compare(from_columns({"t_s": time_s, **inputs, **read}), Pump()).answer


@pytest.mark.parametrize("seed", [1, 2])
def test_a_product_is_known_by_its_factor_in_the_other_channel(seed: int) -> None:
    """The current alone knows `per_W` times `shut_off`; each interval of all channels is of the joint fit."""
    found = answer_to(seed)
    assert (found.verdict, found.effects, found.unexplained) == ("consistent", (), ())
    assert not [note for note in found.notes if "Other values" in note]
    told = {parameter.name: parameter for parameter in found.parameters}
    assert {name: each.value for name, each in told.items()} == pytest.approx(TRUTH, rel=0.12)
    assert told["per_W"].value == pytest.approx(TRUTH["per_W"], rel=0.015)
    for each in told.values():
        std = (each.high - each.low) / 3.29
        assert abs(each.value - TRUTH[each.name]) < 3.5 * std


def test_a_worn_bearing_is_found_beside_them() -> None:
    """In the current alone."""
    found = answer_to(1, worn_A=0.6)
    assert [effect.name for effect in found.effects] == ["bearing-drag"]
    told = {parameter.name: parameter.value for parameter in found.parameters}
    assert told["per_W"] == pytest.approx(TRUTH["per_W"], rel=0.015)
