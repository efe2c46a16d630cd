"""Each attribute of a simulation that is wrong has its own message; all mistakes are told at once."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, ClassVar

import pytest

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.prior import Prior, SensorError
from regolithd.calibration.mismatch.simulation.simulation import Simulation
from regolithd.calibration.mismatch.simulation.statement import check_statement

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


class Tank(Simulation):
    """A level with everything that can be stated."""

    channel, unit, wheel_column = "level_m", "m", "tank"
    inputs = ("pump_V", "valve")
    own_tables = ("tank",)
    parameters: ClassVar = {"area_m2": Prior(0.5, 0.01), "drain": Prior(1, 0)}
    own_to_each_wheel = frozenset({"drain"})
    parameter_effects: ClassVar = {"drain": "leak"}
    sensors: ClassVar = {"pump_V": SensorError(relative=0.1)}
    between_readings: ClassVar = {"valve": "hold", "pump_V": "linear", "other": "blank"}

    def predict(self, inputs: Mapping[str, NDArray[Any]], values: Mapping[str, float]) -> NDArray[Any]:
        """Return the integral of the voltage."""
        return inputs["pump_V"] * values["area_m2"]


def test_what_is_stated_rightly_is_accepted() -> None:
    """Lists do for tuples, and several channels for one."""
    check_statement(Tank())
    several = type("Tanks", (Tank,), {"channel": None, "channels": {"level_m": "m"}, "inputs": ["pump_V"]})
    check_statement(several())


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("channels", ["level_m"], "channels must be a dict from columns to units"),
        ("channel", None, "it must state the recorded column that it predicts"),
        ("channel", 3, "it must state the recorded column that it predicts"),
        ("unit", 3, "unit must be text, not 3"),
        ("wheel_column", None, "wheel_column must be text, not None"),
        ("unloaded_experiment", 1.0, "unloaded_experiment must be text, not 1.0"),
        ("one_way", "no", "one_way must be True or False, not 'no'"),
        ("parameter_effects", ["drain"], "parameter_effects must be a dict of names"),
        ("parameter_effects", {"drain": 3}, "parameter_effects must be a dict of names"),
        (
            "parameter_effects",
            {"drian": "leak"},
            "parameter_effects names drian, which is no parameter; did you mean drain?",
        ),
        ("inputs", "pump_V", "inputs must be a tuple of names"),
        ("inputs", ("pump_V", 3), "inputs must be a tuple of names"),
        ("own_tables", {"tank"}, "own_tables must be a tuple of names"),
        ("predict", Simulation.predict, "it needs a method predict(self, inputs, values)"),
        ("parameters", [Prior(1.0, 1.0)], "parameters must be a dict from names to Prior(value, std, unit)"),
        ("parameters", {"drain": 0.5}, 'parameters["drain"] must be Prior(value, std, unit), not 0.5'),
        ("parameters", {"drain": Prior(float("nan"), 1.0)}, 'parameters["drain"] must have a finite value and std'),
        ("parameters", {"drain": Prior(1.0, float("inf"))}, 'parameters["drain"] must have a finite value and std'),
        ("parameters", {"drain": Prior("half", 1.0)}, 'parameters["drain"] must have a finite value and std'),  # type: ignore[arg-type]
        (
            "parameters",
            {"drain": Prior(1.0, -0.5)},
            'parameters["drain"] must have a std of 0 (exact) or more, not -0.5',
        ),
        (
            "own_to_each_wheel",
            frozenset({"drian"}),
            "own_to_each_wheel names drian, which is no parameter; did you mean",
        ),
        ("sensors", {"pump_V": 0.1}, 'sensors["pump_V"] must be SensorError(relative=…, absolute=…), not 0.1'),
        ("between_readings", {"valve": "spline"}, 'between_readings["valve"] must be one of linear, hold, blank'),
    ],
)
def test_a_wrong_attribute_is_told(name: str, value: object, told: str) -> None:
    """With the class and what is right."""
    wrong = type("Wrong", (Tank,), {name: value})
    with pytest.raises(SimulationError, match=f"^Wrong.*: {re.escape(told)}"):
        check_statement(wrong())


def test_every_mistake_is_told_at_once() -> None:
    """Separated by semicolons."""
    wrong = type("Wrong", (Tank,), {"unit": 3, "inputs": "pump_V"})
    with pytest.raises(SimulationError, match="unit must be text, not 3; inputs must be a tuple"):
        check_statement(wrong())
