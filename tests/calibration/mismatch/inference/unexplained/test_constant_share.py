"""One axis alone whose readings are a constant share off: its sensor's scale, and no law of a covariate."""

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
COUNT, STEP_S = 1200, 0.5
PARAMETERS = {"friction_A": 0.9, "by_load": 0.004}


class RudderDrives(Simulation):
    """The currents of two drives by a load and their friction."""

    channel, unit, wheel_column = "motor_A", "A", "drive"
    inputs = ("load_N", "rate_deg_s", "motor_degC")
    parameters: ClassVar = {"friction_A": Prior(0.9, 0.03, "A"), "by_load": Prior(0.004, 0.0001, "A/N")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the currents."""
        moving = np.sign(inputs["rate_deg_s"])
        return values["friction_A"] * moving + values["by_load"] * inputs["load_N"] * moving**2

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and temperature."""
        return {"wheel_speed": inputs["rate_deg_s"], "temperature": inputs["motor_degC"]}


def answer_to(factor: Array, degC: Array) -> Answer:
    """Return the answer where the readings are this factor times the prediction, both of shape (time, drive)."""
    random = np.random.default_rng(5)
    load = np.cumsum(random.normal(0, 40, (COUNT, 2)), axis=0)
    load -= load.mean(axis=0)
    rate = np.repeat(random.choice([-4.0, -2.0, 0.0, 2.0, 4.0], (COUNT // 20, 2)), 20, axis=0)
    current = RudderDrives().predict({"load_N": load, "rate_deg_s": rate}, PARAMETERS)
    columns = {
        "t_s": np.repeat(STEP_S * np.arange(COUNT), 2),
        "drive": np.tile(["port", "starboard"], COUNT),
        "load_N": load.ravel(),
        "rate_deg_s": rate.ravel(),
        "motor_degC": degC.ravel(),
        "motor_A": (factor * current + random.normal(0, 0.12, (COUNT, 2))).ravel(),
    }
    return compare(columns, RudderDrives()).answer


@pytest.fixture(scope="module")
def warm() -> Array:
    """Return temperatures that swing by a few kelvin about 45 °C, shape (time, drive)."""
    return 45 + 4 * np.sin(np.arange(COUNT)[:, None] / 90 + np.array([0.0, 1.0]))


@pytest.mark.parametrize("gain", [1.06, 0.94])
def test_a_gain_of_one_drive_is_a_constant_share_on_it(gain: float, warm: Array) -> None:
    """Above and below 1: no torque constant at another reference temperature, and not the other drive."""
    answer = answer_to(np.array([gain, 1.0]), warm)
    assert not answer.effects
    (place,) = answer.unexplained
    assert place.wheels == ("port",)
    assert place.curve is not None
    assert (place.curve.coupling, place.curve.hardly_varies) == ("gain", True)
    first = place.suggestions[0]
    assert (first.form, first.equation) == ("constant", "Δmotor_A = c · motor_A predicted")
    assert first.parameters["c"].value == pytest.approx(gain - 1, abs=0.015)


def test_a_torque_constant_that_changes_with_temperature_keeps_its_name(warm: Array) -> None:
    """On one drive, which warms by 60 K."""
    rise = np.linspace(0, 60, COUNT)[:, None] * np.array([1.0, 0.2])
    factor = np.array([1.0, 0.0]) * (1 / (1 - 0.002 * (warm + rise - 25)) - 1) + 1
    answer = answer_to(factor, warm + rise)
    assert [(effect.name, effect.wheels) for effect in answer.effects] == [("torque-constant-temperature", ("port",))]
    assert not answer.unexplained
