"""A slow sensor on a slow machine changes little of the reading, and is told by its time."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.signal import lfilter

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer

    Array = NDArray[np.float64]

ROWS, STEP_S = 6000, 0.2


class Pump(Simulation):
    """A flow in proportion to a speed."""

    channel, unit = "flow_L_s", "L/s"
    inputs = ("pump_speed_rad_s",)
    parameters: ClassVar = {"displaced": Prior(0.1, 0.002, "L/rad")}
    without_effects = ("grade-resistance", "turning-resistance", "slip-sinkage", "soil-transition", "load-cell-drift")

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the flow."""
        return values["displaced"] * inputs["pump_speed_rad_s"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["pump_speed_rad_s"]}


def pumped(filter_s: float = 0.0, leaks: float = 0.0) -> Answer:
    """Compare 20 minutes of eight slow ramps, read through a filter, with a flow that is lost at any speed."""
    rng = np.random.default_rng(5)
    time_s = STEP_S * np.arange(ROWS)
    speed = np.interp(time_s, np.linspace(0, time_s[-1], 17), rng.uniform(30.0, 90.0, 17))
    flow = 0.1 * speed - leaks
    if filter_s:
        kept = np.exp(-STEP_S / filter_s)
        flow = lfilter([1 - kept], [1, -kept], flow - flow[0]) + flow[0]
    columns = {"t_s": time_s, "pump_speed_rad_s": speed, "flow_L_s": flow + rng.normal(0, 0.15, ROWS)}
    return compare(from_columns(columns), Pump()).answer


def test_a_filter_that_changes_less_than_other_effects_must_is_named() -> None:
    """Its time constant is within the interval."""
    (effect,) = pumped(filter_s=3.5).effects
    assert (effect.name, effect.form) == ("sensor-delay", "first-order filter")
    assert effect.parameters["relative_size"].value < 0.02
    delay = effect.parameters["delay_s"]
    assert delay.low < 3.5 < delay.high
    assert delay.high - delay.low < 3.0


def test_another_effect_as_small_has_no_name() -> None:
    """A flow that is lost, of 1.5 % of the mean."""
    assert pumped(leaks=0.015 * 6.0).effects == ()


def test_a_sensor_that_is_on_time_is_not_late() -> None:
    """Without a filter nothing is named."""
    assert pumped().verdict == "consistent"
