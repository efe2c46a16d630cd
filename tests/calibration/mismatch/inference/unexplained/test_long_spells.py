"""Few long spells that parameters can bend for: they are no noise, and no parameter that was stated wrongly."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, SensorError, Simulation, compare

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.answer import Answer

Array = NDArray[np.float64]
COUNT, STEP_S = 1800, 2.0
TIME_S = STEP_S * np.arange(COUNT)
STATED = {"yield_root": 2.6, "plastic_root": 2.4, "thinning_per_K": 0.055}


class Kettle(Simulation):
    """The torque of a stirrer in chocolate, a Casson fluid that thins as it is heated."""

    channel, unit = "torque_Nm", "N·m"
    inputs = ("speed_rad_s", "chocolate_degC")
    one_way = True
    sensors: ClassVar = {"speed_rad_s": SensorError(absolute=0.01)}
    parameters: ClassVar = {
        "yield_root": Prior(2.6, 0.08, "(N·m)^½"),
        "plastic_root": Prior(2.4, 0.07, "(N·m·s)^½"),
        "thinning_per_K": Prior(0.055, 0.003, "1/K"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the torque; 0 at standstill."""
        thin = np.exp(-0.5 * values["thinning_per_K"] * (inputs["chocolate_degC"] - 35))
        root = values["yield_root"] * np.sqrt(thin) + values["plastic_root"] * thin * np.sqrt(inputs["speed_rad_s"])
        return np.sign(inputs["speed_rad_s"]) * root**2

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and temperature."""
        return {"wheel_speed": inputs["speed_rad_s"], "chocolate": inputs["chocolate_degC"]}


def answer_to(added: Array) -> Answer:
    """Return the answer to an hour in which this torque is added; the stirrer stands in the first row alone."""
    random = np.random.default_rng(5)
    speed = np.repeat(random.choice([1.0, 1.5, 2.0, 3.0, 4.0], COUNT // 60), 60)
    speed[0] = 0.0
    chocolate = 44 - 14 * (1 - np.exp(-TIME_S / 900)) + 3 * np.clip((TIME_S - 2400) / 600, 0, 1)
    true = {"speed_rad_s": speed, "chocolate_degC": chocolate}
    slow = np.convolve(random.normal(0, 1, COUNT + 15), np.ones(16) / 4, "valid")
    torque = Kettle().predict(true, STATED) + added * np.sign(speed) + random.normal(0, 0.6, COUNT) + 0.35 * slow
    read = np.where(speed > 0, speed + random.normal(0, 0.01, COUNT), 0.0)
    columns = {"t_s": TIME_S, "speed_rad_s": read, "chocolate_degC": chocolate, "torque_Nm": torque}
    return compare(columns, Kettle()).answer


@pytest.mark.parametrize("size_Nm", [4.0, 7.0, 12.0])
def test_three_long_spells_are_unexplained_over_time(size_Nm: float) -> None:
    """They act for 15, 4 and 12 % of the time, and no parameter had to leave its prior for them."""
    acting = np.zeros(COUNT)
    for begin, end in ((480, 750), (1000, 1070), (1400, 1610)):
        acting[begin:end] = size_Nm
    answer = answer_to(acting)
    assert answer.verdict == "unexplained"
    assert not answer.effects
    (place,) = answer.unexplained
    assert place.covariate == "time"
    assert (place.from_s, place.to_s) == pytest.approx((960, 3220), abs=60)


def test_one_row_at_rest_before_the_motion_has_no_part_in_the_answer() -> None:
    """The speed is exactly 0 there, as at the begin of a run, and is not smoothed to a motion that needs torque."""
    answer = answer_to(np.full(COUNT, 3.0))
    assert [effect.name for effect in answer.effects] == ["coulomb-friction"]
    assert answer.effects[0].parameters["coulomb_current"].value == pytest.approx(3.0, rel=0.35)
    assert not answer.unexplained
