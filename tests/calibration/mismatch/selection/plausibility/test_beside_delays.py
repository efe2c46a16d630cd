"""What a delay hides: a curve, or an effect, that its law does not follow."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Candidate, Coefficient, Prior, Simulation, compare

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch import Problem, Shape
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


def on_one_string(*, late_input: bool, lost: float, seed: int = 3) -> Answer:
    """Return the answer where one string's meter, or its sensor of the sun, is late, and another loses a constant."""
    rng, rows = np.random.default_rng(seed), 1500
    sun = np.clip(0.6 + filtered(rng.normal(0, 1.0, (rows, 3)), 8), 0.1, 1.0)
    power = 5020 * sun + rng.normal(0, 40, sun.shape)
    power[:, 2] -= lost
    recorded = sun.copy()
    late = recorded if late_input else power
    late[3:, 0] = late[:-3, 0].copy()
    columns = {
        "t_s": np.repeat(60.0 * np.arange(rows), 3),
        "string": np.tile(("east", "roof", "west"), rows),
        "power_W": power.ravel(),
        "sun": recorded.ravel(),
        "azimuth_deg": np.repeat(np.linspace(90, 270, rows), 3),
    }
    return compare(columns, Strings()).answer


@pytest.mark.parametrize("late_input", [False, True])
@pytest.mark.parametrize("lost", [0.0, 200.0])
def test_what_is_late_on_one_string_leaves_the_others_on_time(late_input: bool, lost: float) -> None:
    """The delay is that of its string; what another loses is told beside it, and nothing where nothing is."""
    answer = on_one_string(late_input=late_input, lost=lost)
    (effect,) = answer.effects
    assert (effect.name, effect.wheels) == ("sensor-delay", ("east",))
    assert effect.shape["late"] == ("sun" if late_input else "power_W")
    assert effect.parameters["delay_s"].value == pytest.approx(180, abs=15)
    assert [place.wheels for place in answer.unexplained] == ([("west",)] if lost else [])


class Crosstalk(Candidate):
    """A part of the lift that the balance shows as drag."""

    name, covariate = "balance-crosstalk", "lift"
    equation, words = "ΔD = c L", "a part of the lift in the drag channel"
    signature, experiment = "a residual in proportion to the lift", "hang weights on the lift axis"
    source, needs = "calibration of balances", "a lift"
    requires = ("lift",)
    along_motion = False
    coefficients: ClassVar = (Coefficient("share", "1", 0),)

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002
        """Return the lift."""
        return problem.covariates["lift"][None]


class Balance(Simulation):
    """Drag of a wing, in proportion to the dynamic pressure."""

    channel, unit = "drag_N", "N"
    inputs = ("pressure_Pa",)
    parameters: ClassVar = {"area_m2": Prior(0.02, 0.001, "m²")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the drag."""
        return values["area_m2"] * inputs["pressure_Pa"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the lift."""
        return {"lift": inputs["lift_N"]}

    def candidates(self, library: tuple[Candidate, ...]) -> tuple[Candidate, ...]:
        """Return the crosstalk as well."""
        return (*library, Crosstalk())


@pytest.mark.parametrize("share", [0.0, 0.011])
def test_a_small_effect_beside_a_delay_has_its_name(share: float) -> None:
    """It gains less than a hundredth of what the delay explains, and is not of the prediction's changes."""
    rng, rows = np.random.default_rng(5), 1500
    pressure = 500 + 400 * np.sign(np.sin(np.arange(rows) / 4)) * rng.uniform(0.3, 1.0, rows)
    lift = 40 * np.sin(np.arange(rows) / 90)
    drag = 0.0203 * np.concatenate((pressure[:2], pressure[:-2])) + share * lift + rng.normal(0, 1.5, rows)
    columns = {"t_s": 0.2 * np.arange(rows), "drag_N": drag, "pressure_Pa": pressure, "lift_N": lift}
    answer = compare(columns, Balance()).answer
    assert sorted(effect.name for effect in answer.effects) == [
        *(["balance-crosstalk"] if share else []),
        "sensor-delay",
    ]
    assert answer.unexplained == ()
