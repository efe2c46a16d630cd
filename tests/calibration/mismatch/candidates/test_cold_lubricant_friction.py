"""Drag of a cold grease is found by name and by how it grows with speed, on a joint whose gear warms up and cools."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from lifting_axis import LiftingAxis, drive

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Effect

    Array = NDArray[np.float64]

INSTANTS, STEP_S = 4000, 0.2


class Joint(Simulation):
    """Current of a joint that carries a load: gravity and inertia."""

    channel, unit = "motor_current_A", "A"
    inputs = ("speed_rad_s", "angle_rad")
    parameters: ClassVar = {"gravity": Prior(1.0, 0.03, "A")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current of the load."""
        return values["gravity"] * np.cos(inputs["angle_rad"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed, temperature and time."""
        return {
            "wheel_speed": inputs["speed_rad_s"],
            "temperature": inputs["gear_temperature_degC"],
            "time": inputs["t_s"],
        }


def effects_of(power: float, *, scale_K: float = 12.0) -> tuple[Effect, ...]:
    """Return what is found where drag grows by this power of the speed and falls by a factor e in `scale_K`."""
    rng = np.random.default_rng(7)
    t_s = np.arange(INSTANTS) * STEP_S
    angle = 1.2 * np.sin(t_s / 7) + 0.8 * np.sin(t_s / 2.3)
    speed = np.gradient(angle, STEP_S)
    temperature = 12.0 - 14.0 * np.cos(t_s / 90)
    drag = 0.5 * np.exp(-(temperature + 2.0) / scale_K) * np.sign(speed) * np.abs(speed) ** power
    noise = np.convolve(rng.normal(0, 1, INSTANTS + 7), np.ones(8) / np.sqrt(8), "valid")
    columns = {
        "t_s": t_s,
        "motor_current_A": 1.01 * np.cos(angle) + drag + 0.1 * noise,
        "speed_rad_s": speed,
        "angle_rad": angle,
        "gear_temperature_degC": temperature,
    }
    return compare(from_columns(columns), Joint()).answer.effects


@pytest.mark.parametrize("power", [0.0, 0.35, 1.0])
def test_a_grease_is_one_effect_whatever_its_power(power: float) -> None:
    """A grease that thins with shear is between constant and viscous drag, and is not named as both."""
    (found,) = effects_of(power)
    assert (found.name, found.form) == ("cold-lubricant-friction", "Vogel's law")
    told = found.parameters["power"]
    assert told.value == pytest.approx(power, abs=0.15)
    # A power at an end of its range is not inside the interval, which is within the range.
    assert told.low - 0.02 <= power <= told.high + 0.02


@pytest.mark.parametrize("power", [0.1, 0.3])
def test_drag_that_does_not_depend_on_temperature_is_not_cold(power: float) -> None:
    """A power that no other law has does not earn the name."""
    assert "cold-lubricant-friction" not in {effect.name for effect in effects_of(power, scale_K=1e6)}


@pytest.mark.parametrize(
    ("seed", "pole_degC", "scale_K", "noise"),
    [(3, -110.0, 15.0, 0.03), (1, -45.0, 10.0, 0.01), (2, -45.0, 10.0, 0.01), (4, -60.0, 12.0, 0.01)],
)
def test_a_lubricant_of_another_pole_is_one_effect(seed: int, pole_degC: float, scale_K: float, noise: float) -> None:
    """Where the pole was one of two, viscous friction of 2 % was named beside the first one."""

    def vogel(columns: dict[str, Array]) -> Array:
        above, coldest_above = columns["oil_degC"] - pole_degC, 4.0 - pole_degC
        return 0.5 * np.sign(columns["speed_rad_s"]) * np.exp(coldest_above / scale_K * (coldest_above / above - 1))

    answer = compare(drive(seed, vogel, noise=noise), LiftingAxis()).answer
    (effect,) = answer.effects
    assert effect.name == "cold-lubricant-friction"
    assert answer.unexplained == ()
    pole = effect.parameters["pole_degC"]
    assert pole.low is not None
    assert pole.high is not None
    assert pole.low <= pole_degC <= pole.high
