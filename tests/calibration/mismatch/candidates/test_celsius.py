"""The unit of a temperature is that of its column."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from linear_machine import AXES, INSTANTS, problem_of, table

from regolithd.calibration.mismatch.candidates.celsius import known_temperature_degC, temperature_degC

CELSIUS = np.array([[20.0, 30.0], [40.0, np.nan]])


@pytest.mark.parametrize(
    ("column", "values"),
    [
        ("motor_temperature_degC", CELSIUS),
        ("motor_temperature_K", CELSIUS + 273.15),
        ("motor_temperature_degF", CELSIUS * 1.8 + 32.0),
        ("warmth", CELSIUS),
        ("warmth", CELSIUS + 273.15),
    ],
)
def test_a_temperature_is_read_in_its_unit(column: str, values: np.ndarray) -> None:
    """By the name of the column; without a unit there, what is never below 150 is in kelvin."""
    problem = SimpleNamespace(
        covariates={"temperature": values},
        mask=np.isfinite(values),
        recording=SimpleNamespace(channels={"speed_K": np.zeros((2, 2)), column: values}),
    )
    assert temperature_degC(problem) == pytest.approx(CELSIUS, nan_ok=True)  # type: ignore[arg-type]


def test_a_hot_oven_in_degrees_celsius_stays_so() -> None:
    """The name of the column is known, so that its size decides nothing."""
    hot = CELSIUS + 300.0
    problem = SimpleNamespace(
        covariates={"temperature": hot},
        mask=np.isfinite(hot),
        recording=SimpleNamespace(channels={"oven_degC": hot}),
    )
    assert temperature_degC(problem) == pytest.approx(hot, nan_ok=True)  # type: ignore[arg-type]


def test_where_it_is_known_it_is_in_degrees_celsius_too() -> None:
    """Whoever has asked for the covariate in its own unit before: both are computed once."""
    columns = {**table(), "gear_temperature_K": np.linspace(260.0, 300.0, AXES * INSTANTS)}
    problem = problem_of(columns)
    kelvin = problem.recording.channels["gear_temperature_K"]
    warm = replace(problem, covariates={**problem.covariates, "temperature": kelvin})
    assert warm.known("temperature") == pytest.approx(kelvin)
    assert known_temperature_degC(warm) == pytest.approx(kelvin - 273.15)
