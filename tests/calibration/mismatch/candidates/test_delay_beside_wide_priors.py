"""A late voltage of a cell whose resistances and time constant are hardly known: they can stand for a part of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from mass_on_spring import behind

from regolithd.calibration.mismatch import Prior, Simulation, compare, from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROWS, STEP_s, FINE = 3000, 10.0, 40


class Cell(Simulation):
    """A voltage behind a resistance, and one behind a resistance and a capacity."""

    channel, unit = "cell_V", "V"
    inputs = ("current_A",)
    parameters: ClassVar = {
        "ohm": Prior(0.10, 0.01, "Ω"),
        "polar_ohm": Prior(0.05, 0.01, "Ω"),
        "polar_s": Prior(200.0, 30.0, "s"),
        "rest_V": Prior(340.0, 1.0, "V"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the voltage, integrated from rest."""
        current = inputs["current_A"][:, 0]
        kept, polar, course = np.exp(-STEP_s / max(values["polar_s"], 1.0)), 0.0, []
        for now in current.tolist():
            course.append(polar)
            polar = polar * kept + values["polar_ohm"] * now * (1 - kept)
        return (values["rest_V"] + values["ohm"] * current + np.array(course))[:, None]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the current."""
        return {"current": inputs["current_A"]}


def recorded(seed: int, late: int) -> tuple[dict[str, Array], dict[str, float]]:
    """Return a cell that is charged and discharged in steps, its voltage late by so many readings, and the truth."""
    rng = np.random.default_rng(seed)
    lengths = rng.integers(10, 60, ROWS)
    current = np.repeat(rng.uniform(-40, 40, ROWS), lengths)[:ROWS]
    truth = {name: float(rng.normal(prior.value, 0.8 * prior.std)) for name, prior in Cell.parameters.items()}
    voltage = Cell().predict({"current_A": current[:, None]}, truth)[:, 0]
    voltage = np.concatenate((np.full(late, voltage[0]), voltage))[:ROWS]
    slow = np.zeros(ROWS)
    for row in range(1, ROWS):
        slow[row] = 0.8 * slow[row - 1] + rng.normal(0, 0.3)
    columns = {
        "t_s": np.arange(ROWS) * STEP_s,
        "current_A": current,
        "cell_V": voltage + slow + rng.normal(0, 0.5, ROWS),
    }
    return columns, truth


@pytest.mark.parametrize(("seed", "late"), [(1, 5), (2, 7), (6, 10)])
def test_a_delay_has_its_name_and_the_parameters_their_values(seed: int, late: int) -> None:
    """It is fitted with the delay; where it is fitted without one first, the last is unexplained."""
    columns, truth = recorded(seed, late)
    answer = compare(from_columns(columns), Cell()).answer
    (effect,) = answer.effects
    delay = effect.parameters["delay_s"]
    assert effect.name == "sensor-delay"
    assert delay.value == pytest.approx(late * STEP_s, abs=0.5)
    assert answer.unexplained == ()
    # Twice the half-width of the 90 % interval holds the truth 999 times in 1000.
    for each in answer.parameters:
        assert abs(truth[each.name] - each.value) < each.high - each.low, each.name


def test_an_oscillation_is_no_hidden_delay() -> None:
    """A free response to the past explains it better than a delay with other parameters does."""
    columns, truth = recorded(13, 0)
    true = Cell().predict({"current_A": columns["current_A"][:, None]}, truth)[:, 0]
    shown = behind(np.repeat(true, FINE), FINE, STEP_s / FINE, 0.008, 0.26)
    columns["cell_V"] = columns["cell_V"] + 0.6 * (shown - true)
    answer = compare(from_columns(columns), Cell()).answer
    assert answer.verdict == "unexplained"
    assert [place.covariate for place in answer.unexplained] == ["lagged_prediction"]
    assert answer.effects == ()
