"""Friction of a machine whose noisy speed hardly shows where it stands, beside a force that does."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, SensorError, Simulation, compare

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.answer import Answer

Array = NDArray[np.float64]
COUNT, STEP_S = 1500, 0.1


class Carriage(Simulation):
    """The current of a drive that pushes a load to and fro."""

    channel, unit = "current_A", "A"
    inputs = ("speed_m_s", "load_N")
    parameters: ClassVar = {"gain_A_N": Prior(0.05, 0.001, "A/N")}
    sensors: ClassVar = {"speed_m_s": SensorError(absolute=0.02)}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current."""
        return values["gain_A_N"] * inputs["load_N"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and load."""
        return {"wheel_speed": inputs["speed_m_s"], "load_force": inputs["load_N"]}


class Signed(Carriage):
    """The same, with the direction that the load shows."""

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed with the sign of the load, which is 0 at standstill."""
        of_load = np.abs(inputs["speed_m_s"]) * np.sign(inputs["load_N"])
        return {**super().covariates(inputs), "wheel_speed": of_load}


def answer(machine: Simulation, friction_A: float = 6.0, spring_A: float = 0.0) -> Answer:
    """Compare with a drive that has friction, and what grows with the load beyond 200 N."""
    random = np.random.default_rng(8)
    way, load = np.zeros(COUNT), np.zeros(COUNT)
    at, sign = 0, 1
    while at < COUNT:
        moving, resting = random.integers(4, 15, size=2)
        way[at : at + moving], load[at : at + moving] = sign, sign * random.uniform(40, 300)
        at, sign = at + moving + resting, -sign
    speed = way * random.uniform(0.03, 0.4, COUNT).round(2)
    current = 0.05 * load + friction_A * way + spring_A * np.sign(load) * np.maximum(np.abs(load) - 200, 0) / 100
    return compare(
        {
            "t_s": STEP_S * np.arange(COUNT),
            "speed_m_s": speed + random.normal(0, 0.02, COUNT),
            "load_N": load,
            "current_A": current + random.normal(0, 0.8, COUNT),
        },
        machine,
    ).answer


def test_a_force_with_the_sign_of_the_motion_is_told_as_what_shows_its_direction() -> None:
    """Friction follows it more closely than the noisy speed; returned so, it has its name and size."""
    by_speed = answer(Carriage())
    assert [place.covariate for place in by_speed.unexplained] == ["load_force"]
    (note,) = [note for note in by_speed.notes if "follows its sign" in note]
    assert "return wheel_speed with its sign, and 0 at standstill" in note
    by_load = answer(Signed())
    (effect,) = by_load.effects
    assert effect.name == "coulomb-friction"
    assert effect.parameters["coulomb_current"].low < 6.0 < effect.parameters["coulomb_current"].high


def test_what_grows_with_a_force_is_no_direction() -> None:
    """Its sign explains little of that."""
    found = answer(Carriage(), friction_A=0.0, spring_A=8.0)
    assert found.unexplained
    assert not any("follows its sign" in note for note in found.notes)
