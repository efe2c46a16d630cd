"""A law over time beside a temperature that rises with it: what has no name over the temperature is as probable."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.answer import Answer

Array = NDArray[np.float64]
COUNT, STEP_S = 2400, 0.3
TIME_S = STEP_S * np.arange(COUNT)


class Lift(Simulation):
    """The pressure of a cylinder by its load, and in the line by the flow."""

    channel, unit = "pressure_bar", "bar"
    inputs = ("load_kg", "speed_m_s")
    parameters: ClassVar = {"by_load": Prior(0.030, 0.001, "bar/kg"), "by_flow": Prior(90.0, 6.0, "bar·s/m")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the pressure."""
        return values["by_load"] * inputs["load_kg"] + values["by_flow"] * inputs["speed_m_s"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and temperature."""
        return {"wheel_speed": inputs["speed_m_s"], "temperature": inputs["oil_degC"]}


def answer_to(oil: Array, drag: Array) -> Answer:
    """Return the answer where a drag is left out, at this temperature of the oil, both of shape (time,)."""
    random = np.random.default_rng(8)
    speed = np.repeat(random.choice([0.05, 0.08, -0.05, -0.08, 0.0], COUNT // 60), 60)
    load = np.repeat(random.uniform(300, 1200, COUNT // 120), 120)
    pressure = Lift().predict({"load_kg": load, "speed_m_s": speed}, {"by_load": 0.0305, "by_flow": 93.0})
    pressure = pressure + drag * np.sign(speed) + random.normal(0, 0.2, COUNT)
    columns = {"t_s": TIME_S, "load_kg": load, "speed_m_s": speed, "oil_degC": oil, "pressure_bar": pressure}
    return compare(columns, Lift()).answer


@pytest.fixture(scope="module")
def warming() -> Array:
    """Return a temperature that rises by stages, and never falls."""
    return 19 + 27 * (1 - np.exp(-TIME_S / 500)) + 0.3 * np.cumsum(np.sin(TIME_S / 40) > 0) / 100


def test_a_law_over_time_is_no_more_probable_than_a_curve_over_what_rises_with_it(warming: Array) -> None:
    """The drag begins at 24 °C, which no law of the library does: the name is told as not sure, with the reason."""
    answer = answer_to(warming, 0.3 * np.maximum(warming - 24, 0))
    assert answer.probability is not None
    assert answer.probability < 0.6
    assert answer.alternatives[0].unexplained
    assert any("go together in this recording" in note for note in answer.notes)


def test_where_the_temperature_varies_by_itself_the_law_is_sure(warming: Array) -> None:
    """The oil is cooled again and again, and the drag grows with the time alone."""
    drag = 4 * np.clip((TIME_S - 240) / 480, 0, 1) ** 1.5
    answer = answer_to(warming - 12 * (np.sin(TIME_S / 60) > 0.3), drag)
    assert [effect.name for effect in answer.effects] == ["bearing-drag"]
    assert answer.probability is not None
    assert answer.probability > 0.9
