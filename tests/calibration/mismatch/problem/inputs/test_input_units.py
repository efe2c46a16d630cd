"""An input in another unit than its name says is told, where a conversion explains nearly all that is left."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, RecordingError, Simulation, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROWS = 2000
RNG = np.random.default_rng(3)
RAMP_RAD, ROOM_DEGC = np.cumsum(RNG.normal(0, 0.01, ROWS)) % 0.3, 20 + 5 * np.sin(np.arange(ROWS) / 200)


class Climbing(Simulation):
    """A current that carries a weight up a ramp, through air whose density falls with its temperature."""

    channel, unit = "motor_A", "A"
    inputs = ("ramp_rad", "room_degC")
    parameters: ClassVar = {"gain_A": Prior(8.0, 0.1, "A"), "air_A": Prior(300.0, 10.0, "A K")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the weight's part and the air's."""
        return values["gain_A"] * np.sin(inputs["ramp_rad"]) + values["air_A"] / (inputs["room_degC"] + 273.15)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return both inputs."""
        return {"pitch": inputs["ramp_rad"], "temperature": inputs["room_degC"]}


def columns(left_out: float = 0.0) -> dict[str, Array]:
    """Return a recording with white noise, and without a part of the current that follows the ramp."""
    current = (8 + left_out) * np.sin(RAMP_RAD) + 300 / (ROOM_DEGC + 273.15) + RNG.normal(0, 0.05, ROWS)
    return {"t_s": np.arange(ROWS) * 0.1, "motor_A": current, "ramp_rad": RAMP_RAD, "room_degC": ROOM_DEGC}


def notes_of(table: dict[str, Array]) -> list[str]:
    """Return the notes on units."""
    notes = build_problem(from_columns(table), Climbing()).recording.notes
    return [note for note in notes if "is likely in" in note]


def test_a_temperature_in_kelvin_has_a_note_with_the_cure() -> None:
    """The recording is compared all the same."""
    (note,) = notes_of({**columns(), "room_degC": ROOM_DEGC + 273.15})
    assert note.startswith("room_degC is likely in K: ")
    assert "Convert the column to degC" in note


def test_a_simulation_that_predicts_nothing_by_a_unit_is_an_error() -> None:
    """Names of what is left would be names of the mistake."""
    with pytest.raises(RecordingError, match=r"ramp_rad is likely in deg: .* Convert the column to rad"):
        build_problem(from_columns({**columns(), "ramp_rad": np.rad2deg(RAMP_RAD)}), Climbing())


class Loaded(Climbing):
    """A simulation with a part that the machine does not have, a hundred times the current."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current, and what the ramp does not add."""
        return super().predict(inputs, values) + 3000 * inputs["ramp_rad"]


def test_an_input_that_should_do_less_is_no_other_unit() -> None:
    """In degrees a spurious part would be 57 times smaller, and still spurious."""
    notes = build_problem(from_columns(columns()), Loaded()).recording.notes
    assert not any("is likely in" in note for note in notes)


@pytest.mark.parametrize("left_out", [0.0, 2.0, 8.0])
def test_what_is_left_out_is_no_other_unit(left_out: float) -> None:
    """However large it is."""
    assert notes_of(columns(left_out)) == []


class Hoisting(Climbing):
    """A current that holds a load by its weight."""

    inputs = ("load_kg",)
    parameters: ClassVar = {"constant_A_N": Prior(0.02, 0.001, "A/N")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current."""
        return values["constant_A_N"] * 9.81 * inputs["load_kg"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the load."""
        return {"load": inputs["load_kg"]}


def test_a_mass_that_is_recorded_as_a_weight_is_an_error() -> None:
    """No parameter is ten times as large as stated."""
    load = 30 + 10 * np.sin(np.arange(ROWS) / 100)
    recording = {"t_s": np.arange(ROWS) * 0.1, "motor_A": 0.02 * 9.81 * load, "load_kg": 9.81 * load}
    with pytest.raises(RecordingError, match="load_kg is likely in N: "):
        build_problem(from_columns(recording), Hoisting())


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "mA"), (1.0, None)])
def test_a_predicted_column_in_another_unit_is_an_error(factor: float, unit: str | None) -> None:
    """No physics makes a current a thousand times as large."""
    table = {**columns(), "motor_A": factor * columns()["motor_A"]}
    if unit is None:
        assert not notes_of(table)
        return
    with pytest.raises(RecordingError, match=f"motor_A is likely in {unit}: .* Convert the column to A"):
        build_problem(from_columns(table), Climbing())


class Turning(Climbing):
    """A current that grows with the root of a speed."""

    inputs = ("speed_rad_s",)
    parameters: ClassVar = {"drag_A": Prior(0.9, 0.02, "A √(s/rad)")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the drag's part."""
        return values["drag_A"] * np.sqrt(inputs["speed_rad_s"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"speed": inputs["speed_rad_s"]}


def test_of_several_units_the_one_that_fits_best_is_told() -> None:
    """Degrees per second leave a tenth of what the readings leave, revolutions per minute next to nothing."""
    speed = 6 + 2 * np.sin(np.arange(ROWS) / 50)
    table = {
        "t_s": np.arange(ROWS) * 0.1,
        "motor_A": 0.9 * np.sqrt(speed) + RNG.normal(0, 0.05, ROWS),
        "speed_rad_s": speed * 30 / np.pi,
    }
    with pytest.raises(RecordingError, match="speed_rad_s is likely in rpm"):
        build_problem(from_columns(table), Turning())


class Pumping(Climbing):
    """A current that grows with a flow, and with the square of the difference of two temperatures."""

    inputs = ("flow_m3_h", "inlet_degC", "outlet_degC")
    parameters: ClassVar = {"flow_A": Prior(3.0, 0.1, "A h/m³")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current."""
        warmer = inputs["outlet_degC"] - 1.5 * inputs["inlet_degC"]
        return values["flow_A"] * inputs["flow_m3_h"] + 0.01 * warmer**2

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the flow."""
        return {"flow": inputs["flow_m3_h"]}


def pumped() -> dict[str, Array]:
    """Return a recording of it."""
    rows = np.arange(ROWS)
    flow, inlet, outlet = 2 + np.sin(rows / 60), 20 + 3 * np.sin(rows / 150), 45 + 5 * np.sin(rows / 90)
    current = 3 * flow + 0.01 * (outlet - 1.5 * inlet) ** 2 + RNG.normal(0, 0.05, ROWS)
    return {"t_s": rows * 0.1, "motor_A": current, "flow_m3_h": flow, "inlet_degC": inlet, "outlet_degC": outlet}


@pytest.mark.parametrize(
    ("one", "other"),
    [("flow_m3_h", "inlet_degC"), ("inlet_degC", "outlet_degC"), ("motor_A", "outlet_degC"), ("motor_A", "flow_m3_h")],
)
def test_columns_that_have_each_other_s_readings_are_told(one: str, other: str) -> None:
    """Two inputs, or an input and what is predicted: no unit is told in their place."""
    right = pumped()
    assert build_problem(from_columns(right), Pumping()).recording.notes == ()
    with pytest.raises(RecordingError, match=rf"{one} and {other} likely have each other's readings: .*Swap the names"):
        build_problem(from_columns({**right, one: right[other], other: right[one]}), Pumping())


def test_a_flow_in_another_unit_is_told() -> None:
    """Litres per minute are no cubic metres per hour."""
    right = pumped()
    with pytest.raises(RecordingError, match="flow_m3_h is likely in l/min"):
        build_problem(from_columns({**right, "flow_m3_h": right["flow_m3_h"] / 0.06}), Pumping())


class Heated(Climbing):
    """A temperature above that of the room."""

    channel, unit = "motor_K", "K"
    parameters: ClassVar = {"rise_K": Prior(30.0, 10.0, "K")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the room's temperature and what the motor and the ramp heat."""
        return inputs["room_degC"] + 273.15 + values["rise_K"] + 20 * inputs["ramp_rad"]


class HeatedAsKnown(Heated):
    """The same with a rise that is known well."""

    parameters: ClassVar = {"rise_K": Prior(30.0, 3.0, "K")}


def test_a_parameter_within_its_prior_is_no_other_unit() -> None:
    """A room in degrees Fahrenheit is 27 K colder at 20 than in degrees Celsius: so is a motor that rises by 3 K."""
    rise, room = 10 / 3, 20 + 0.5 * np.sin(np.arange(ROWS) / 200)
    current = room + 273.15 + rise + 20 * RAMP_RAD + np.random.default_rng(5).normal(0, 0.05, ROWS)
    table = from_columns(
        {"t_s": np.arange(ROWS) * 0.1, "motor_K": current, "ramp_rad": RAMP_RAD, "room_degC": room},
    )
    assert build_problem(table, Heated()).recording.notes == ()
    with pytest.raises(RecordingError, match="room_degC is likely in °F"):
        build_problem(table, HeatedAsKnown())
