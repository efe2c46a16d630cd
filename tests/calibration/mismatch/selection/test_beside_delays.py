"""What a delay hides: a curve that its law does not follow."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.answer import Answer

Array = NDArray[np.float64]


class Strings(Simulation):
    """Power of three strings of a photovoltaic array."""

    channel, unit, wheel_column = "power_W", "W", "string"
    inputs = ("sun",)
    parameters: ClassVar = {"peak_W": Prior(5000.0, 50.0, "W")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the power."""
        return values["peak_W"] * inputs["sun"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the sun's azimuth, over which a shadow acts."""
        return {"azimuth": inputs["azimuth_deg"], "time": inputs["t_s"]}


def filtered(values: Array, readings: float) -> Array:
    """Return values after a first-order filter, shape (time, …)."""
    found, share = values.copy(), 1 - np.exp(-1 / readings)
    for at in range(1, len(values)):
        found[at] = found[at - 1] + share * (values[at] - found[at - 1])
    return found


def shadowed(depth: float, seed: int = 0) -> Answer:
    """Return the answer for strings behind a slow meter, of which one is in a shadow over 40 degrees of azimuth."""
    rng, rows = np.random.default_rng(seed), 1500
    days = np.linspace(0, 2, rows, endpoint=False) % 1
    azimuth = 90 + 180 * days
    clouds = np.clip(0.7 + filtered(rng.normal(0, 1.5, (rows, 3)), 8), 0.15, 1.0)
    sun = np.sin(np.pi * np.clip(days, 0.03, 0.97))[:, None] * clouds
    power = 5030 * sun
    power[:, 0] *= 1 - depth * np.exp(-(((azimuth - 150) / 20) ** 2) / 2)
    power = filtered(power, 3) + rng.normal(0, 30, power.shape)
    columns = {
        "t_s": np.repeat(60.0 * np.arange(rows), 3),
        "string": np.tile(("east", "roof", "west"), rows),
        "power_W": power.ravel(),
        "sun": sun.ravel(),
        "azimuth_deg": np.repeat(azimuth, 3),
    }
    return compare(columns, Strings()).answer


def test_a_delay_alone_leaves_nothing() -> None:
    """The misfit of the delay's law is none."""
    answer = shadowed(0.0)
    assert answer.verdict == "missing-physics"
    assert [effect.name for effect in answer.effects] == ["sensor-delay"]


def test_a_shadow_beside_a_delay_that_explains_far_more_is_told() -> None:
    """It adds a hundredth to what the delay explains, and acts where the delay does not."""
    answer = shadowed(0.15)
    assert answer.verdict == "unexplained"
    assert [effect.name for effect in answer.effects] == ["sensor-delay"]
    (place,) = answer.unexplained
    assert (place.covariate, place.wheels) == ("azimuth", ("east",))
