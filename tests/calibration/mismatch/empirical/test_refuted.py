"""A curve has to lower the error of held-out readings."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from heated_room import ReadRoom, recorded

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.empirical import refuted

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

COUNT = 3000


class Pump(Simulation):
    """A pressure in proportion to the square of a speed that is set."""

    channel, unit = "pressure_bar", "bar"
    inputs = ("set_rpm",)
    parameters: ClassVar = {"gain": Prior(1e-5, 5e-7, "bar/rpm²")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the pressure."""
        return values["gain"] * inputs["set_rpm"] ** 2

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the opening of a valve."""
        return {"opening": inputs["opening_pct"]}


def pumped(seed: int) -> Recording:
    """Return a recording in which a valve takes a pressure, most where it is half open."""
    random = np.random.default_rng(seed)
    speed = np.repeat(random.uniform(500, 1500, COUNT // 30), 30)
    opening = 50 + 50 * np.sin(np.arange(COUNT) / 70) * np.sin(np.arange(COUNT) / 333)
    pressure = 1e-5 * speed**2 - 1.5 * np.exp(-(((opening - 50) / 15) ** 2)) + random.normal(0, 1, COUNT)
    return from_columns(
        {"t_s": 0.5 * np.arange(COUNT), "set_rpm": speed, "opening_pct": opening, "pressure_bar": pressure}
    )


def test_a_curve_that_held_out_readings_do_not_confirm_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that does is a finding; the least gain decides."""
    found = compare(pumped(1), Pump()).answer
    assert [place.covariate for place in found.unexplained] == ["opening"]
    curve = found.unexplained[0].curve
    assert curve is not None
    gain = 1 - curve.held_out_rmse_after / curve.held_out_rmse_before
    monkeypatch.setattr(refuted, "LEAST_GAIN", 1.01 * gain)
    assert compare(pumped(1), Pump()).answer.unexplained == ()


@pytest.mark.parametrize("seed", [1, 2])
def test_what_errors_give_by_themselves_is_no_finding(seed: int) -> None:
    """A room that a noisy current heats wanders; a curve over time would follow that as it would follow physics."""
    assert compare(recorded(seed), ReadRoom()).answer.verdict == "consistent"
