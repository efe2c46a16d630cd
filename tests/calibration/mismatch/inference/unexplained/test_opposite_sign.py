"""A generator whose speed has the sign of a motor's: its friction has the wrong sign, which a note says."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]
COUNT = 2400


class Turbine(Simulation):
    """The power that a water turbine of variable speed gives."""

    channel, unit = "power_kW", "kW"
    inputs = ("flow_m3_s", "head_m", "speed_rad_s")
    one_way = True
    parameters: ClassVar = {"efficiency": Prior(0.88, 0.03, "1")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return what the water gives."""
        return 9.81 * values["efficiency"] * inputs["flow_m3_s"] * inputs["head_m"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed with the sign of a motor's, and the head."""
        return {"wheel_speed": inputs["speed_rad_s"], "head": inputs["head_m"]}


class Generating(Turbine):
    """The same, whose friction takes from the power."""

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed with the sign of a generator's."""
        return {**super().covariates(inputs), "wheel_speed": -inputs["speed_rad_s"]}


def recorded(drag_kW: float, at_low_head_kW: float = 0.0) -> dict[str, Array]:
    """Return a recording with quadratic drag, kW at 30 rad/s, and what is lost below 23 m of head."""
    random = np.random.default_rng(11)
    flow, speed, head = (np.repeat(random.uniform(low, high, COUNT // 40), 40) for low, high in RANGES)
    power = Turbine().predict({"flow_m3_s": flow, "head_m": head}, {"efficiency": 0.89})
    lost = drag_kW * (speed / 30) ** 2 + np.where(head < 23, at_low_head_kW, 0.0)
    shown = power - lost + random.normal(0, 15.0, COUNT)
    return {"t_s": np.arange(COUNT), "flow_m3_s": flow, "head_m": head, "speed_rad_s": speed, "power_kW": shown}


RANGES = ((2.0, 6.0), (15.0, 35.0), (21.0, 27.0))


def test_friction_that_takes_from_what_a_generator_gives_is_named_with_its_sign() -> None:
    """With a motor's it is unexplained, and a note says what it would be and what to return."""
    motor = compare(recorded(drag_kW=80.0), Turbine()).answer
    assert motor.effects == ()
    assert [place.covariate for place in motor.unexplained] == ["wheel_speed"]
    (note,) = [note for note in motor.notes if "opposite" in note]
    assert "would be quadratic-drag if that took from power_kW" in note
    generator = compare(recorded(drag_kW=80.0), Generating()).answer
    (effect,) = generator.effects
    assert effect.name == "quadratic-drag"
    coefficient = effect.parameters["quadratic_coefficient"]
    assert coefficient.low < 80.0 / 30**2 < coefficient.high
    assert generator.unexplained == ()


@pytest.mark.parametrize("simulation", [Turbine, Generating])
def test_what_follows_something_else_is_no_friction(simulation: type[Turbine]) -> None:
    """No note."""
    answer = compare(recorded(drag_kW=0.0, at_low_head_kW=120.0), simulation()).answer
    assert [place.covariate for place in answer.unexplained] == ["head"]
    assert not any("opposite" in note for note in answer.notes)
