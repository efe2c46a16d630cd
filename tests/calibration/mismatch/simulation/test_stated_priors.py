"""SIM.toml states priors in `[parameters]` or in tables of the user's own; a mistake is one message with its place."""

from __future__ import annotations

from typing import Any

import pytest

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.prior import Prior
from regolithd.calibration.mismatch.simulation.stated_priors import stated_priors

PRIORS = {"area_m2": Prior(0.5, 0.01, "m2"), "drain_std": Prior(1.0, 0.1)}


def stated(**tables: Any) -> dict[str, Prior]:
    """Return the priors of tables beside `[simulation]`."""
    return stated_priors({"simulation": {"model": "tank:Tank"}, **tables}, PRIORS)


def test_a_table_of_the_users_own_replaces_value_and_spread() -> None:
    """Absolute and relative standard deviations are both understood."""
    assert stated(tank={"area_m2": 0.6, "area_m2_std": 0.02})["area_m2"] == Prior(0.6, 0.02, "m2")
    relative = stated(tank={"area_m2": 0.6, "area_m2_relative_std": 0.1})["area_m2"]
    assert relative.std == pytest.approx(0.06)


def test_a_parameter_whose_name_ends_like_a_spread_is_a_parameter() -> None:
    """The name of a parameter comes first."""
    assert stated(tank={"drain_std": 2.0})["drain_std"] == Prior(2.0, 0.1)


def test_parameters_win_over_other_tables() -> None:
    """A corrected file writes the calibrated value there, beside the table that it was read from."""
    found = stated(parameters={"area_m2": {"value": 0.7, "std": 0.0}}, tank={"area_m2": 0.6})
    assert found["area_m2"] == Prior(0.7, 0.0, "m2")


@pytest.mark.parametrize(
    ("tables", "told"),
    [
        ({"tank": {"aera_m2": 0.6}}, "did you mean area_m2"),
        ({"tank": {"area_m2": "wide"}}, "[tank] area_m2: a finite number is needed, not 'wide'"),
        ({"parameters": {"area_m2": 3}}, "[parameters.area_m2] takes value, std, unit and own"),
        ({"parameters": {"area_m2": {"value": "x"}}}, "[parameters.area_m2] value: a finite number"),
        ({"parameters": {"volume": {}}}, "[parameters]: the simulation has no parameter volume"),
        ({"area_m2": 3}, "a parameter stands in a table"),
        ({"tank": {"area_m2_std": -0.1}}, "[tank] area_m2_std: a standard deviation is 0 (exact) or more, not -0.1"),
        ({"parameters": {"area_m2": {"std": -1}}}, "[parameters.area_m2] std: a standard deviation is 0"),
    ],
)
def test_a_mistake_names_table_key_and_cure(tables: dict[str, Any], told: str) -> None:
    """One message, never a traceback of Python's own."""
    with pytest.raises(SimulationError) as caught:
        stated(**tables)
    assert told in str(caught.value)


def test_a_spread_whose_square_has_no_digits_is_exact() -> None:
    """Its precision would be infinite."""
    found = stated_priors({"parameters": {"area_m2": {"value": 0.5, "std": 1e-308}}}, {"area_m2": Prior(0.4, 0.1)}, ())
    assert found["area_m2"] == Prior(0.5, 0.0)
