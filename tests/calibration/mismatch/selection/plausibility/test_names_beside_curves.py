"""Names of effects on one axis beside a curve that all axes share, and what a curve's gain asks of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.answer import Answer

Array = NDArray[np.float64]
COUNT, STEP_S, AXES = 960, 0.4, 4


class Feed(Simulation):
    """The current of four feed rollers: idling, and by the force with which they clamp the log."""

    channel, unit = "current_A", "A"
    wheel_column = "roller"
    inputs = ("speed_rad_s", "clamp_kN")
    without_effects = ("wheel-angle-ripple", "sensor-delay", "rotor-inertia")  # which cost most of the time
    parameters: ClassVar = {"idle_A": Prior(2.0, 0.1, "A"), "by_clamp_A_kN": Prior(1.6, 0.05, "A/kN")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current."""
        return np.sign(inputs["speed_rad_s"]) * (values["idle_A"] + values["by_clamp_A_kN"] * inputs["clamp_kN"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and line voltage."""
        return {"wheel_speed": inputs["speed_rad_s"], "line": inputs["line_V"]}


def answer_to(of_line_A: float, on_one: Array, seed: int = 3) -> Answer:
    """Return the answer where the line's voltage acts on all rollers, and something on the third, shape (time,)."""
    random = np.random.default_rng(seed)
    way = np.repeat(random.choice([1.0, 1.0, -1.0], COUNT // 40), 40)
    speed = np.tile((way * np.repeat(random.uniform(4, 10, COUNT // 40), 40))[:, None], AXES)
    clamp = np.repeat(random.uniform(2, 6, (COUNT // 30, AXES)), 30, axis=0)
    line = 403 + 12 * np.sin(np.arange(COUNT) / 57)[:, None] + random.normal(0, 0.5, (COUNT, 1))
    current = Feed().predict({"speed_rad_s": speed, "clamp_kN": clamp}, {"idle_A": 1.9, "by_clamp_A_kN": 1.65})
    current += of_line_A * np.sign(speed) * np.tanh((400 - line) / 8)
    current[:, 2] += on_one * np.sign(speed[:, 2])
    current += 0.8 * random.standard_normal(current.shape)
    columns = {
        "t_s": np.repeat(STEP_S * np.arange(COUNT), AXES),
        "roller": np.tile(np.arange(1, AXES + 1), COUNT),
        "current_A": current.ravel(),
        "speed_rad_s": speed.ravel(),
        "clamp_kN": clamp.ravel(),
        "line_V": np.tile(line, AXES).ravel(),
    }
    return compare(from_columns(columns, unit="roller"), Feed()).answer


def test_a_drag_that_begins_on_one_axis_is_named_beside_a_curve_of_all() -> None:
    """The curve that the others follow, too, does not come and go with the drag."""
    answer = answer_to(1.9, np.where(np.arange(COUNT) >= 480, 2.3, 0.0))
    assert {(place.covariate, place.wheels) for place in answer.unexplained} == {("line", (1, 2, 3, 4))}
    (effect,) = answer.effects
    assert (effect.name, effect.wheels) == ("bearing-drag", (3,))
    assert effect.onset_s == pytest.approx(192, abs=30)


def test_a_constant_drag_of_one_axis_is_named_beside_a_curve_of_all() -> None:
    """It gains less than a tenth of what the curve gains on all axes, and more than a tenth of that on its own."""
    answer = answer_to(1.9, np.full(COUNT, 0.8))
    assert {place.covariate for place in answer.unexplained} == {"line"}
    assert [(effect.name, effect.wheels) for effect in answer.effects] == [("coulomb-friction", (3,))]


def test_a_curve_of_all_axes_alone_lends_no_axis_a_name() -> None:
    """Nothing acts on the third roller."""
    answer = answer_to(1.9, np.zeros(COUNT))
    assert not answer.effects
    assert {place.covariate for place in answer.unexplained} == {"line"}
