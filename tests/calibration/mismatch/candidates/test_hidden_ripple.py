"""A ripple that a larger effect hides is found in what the larger one leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]
COUNT, STEP_S, WINCHES, ORDER, AMPLITUDE_A = 1500, 0.1, 4, 7.0, 1.0


class Winches(Simulation):
    """The current of winches by the load on their ropes and their friction."""

    channel, unit, wheel_column = "current_A", "A", "wheel"
    inputs = ("rope_m_s", "load_kg")
    parameters: ClassVar = {"lift_A_kg": Prior(0.5, 0.01, "A/kg")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return what lifts."""
        return values["lift_A_kg"] * inputs["load_kg"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["rope_m_s"]}


def hoisted(seed: int) -> Recording:
    """Return drives to and fro with a drag of the square of the speed on all, and a ripple on the first winch."""
    random, time = np.random.default_rng(seed), STEP_S * np.arange(COUNT)
    stops = np.linspace(0, time[-1], 30)
    speed = np.stack([np.interp(time, stops, random.uniform(-2.5, 2.5, 30)) for _ in range(WINCHES)], axis=1)
    load = 25 + 8 * np.stack([np.interp(time, stops, random.normal(size=30)) for _ in range(WINCHES)], axis=1)
    travel = np.cumsum(speed, axis=0) * STEP_S
    ripple = AMPLITUDE_A * np.cos(ORDER * travel) * (np.arange(WINCHES) == 0)
    current = 0.5 * load + 2.0 * speed * np.abs(speed) + ripple + random.normal(0, 0.7, speed.shape)
    columns = {
        "t_s": np.repeat(time, WINCHES),
        "wheel": np.tile(np.arange(1.0, WINCHES + 1), COUNT),
        "rope_m_s": speed.ravel(),
        "load_kg": load.ravel(),
        "current_A": current.ravel(),
    }
    return from_columns(columns)


def test_a_ripple_beside_a_larger_drag_has_its_name_and_order() -> None:
    """On its winch, with its amplitude; a slow drag has far more power at low orders than the ripple has at its own."""
    answer = compare(hoisted(1), Winches()).answer
    found = {effect.name: effect for effect in answer.effects}
    assert set(found) == {"quadratic-drag", "wheel-angle-ripple"}
    ripple = found["wheel-angle-ripple"]
    assert ripple.wheels == (1,)
    amplitude, order = ripple.parameters["amplitude"], ripple.parameters["order"]
    assert amplitude.low < AMPLITUDE_A < amplitude.high
    assert order.low - 0.01 < ORDER < order.high + 0.01
