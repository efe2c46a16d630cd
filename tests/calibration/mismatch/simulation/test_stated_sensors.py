"""`[sensors]` of SIM.toml states standard errors of recorded inputs, the same way for a class and an FMU."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.prior import Prior, SensorError
from regolithd.calibration.mismatch.simulation.checked import checked
from regolithd.calibration.mismatch.simulation.simulation import Simulation


class Joint(Simulation):
    """A joint whose class states the error of one input."""

    channel, unit = "torque_Nm", "N·m"
    inputs = ("speed_rad_s", "load_N", "opening")
    parameters: ClassVar = {"speed_std": Prior(1.0, 0.1)}
    sensors: ClassVar = {"load_N": SensorError(relative=0.5)}

    def predict(self, inputs: Any, values: Any) -> Any:
        """Return the speed."""
        return values["speed_std"] * inputs["speed_rad_s"]


class OwnTable(Joint):
    """A joint that reads `[sensors]` itself."""

    own_tables = ("sensors",)


def sensors(**stated: Any) -> Any:
    """Return the errors with these keys in `[sensors]`."""
    return Joint.from_tables({"simulation": {}, "sensors": stated}).sensors


@pytest.mark.parametrize(
    ("key", "column", "error"),
    [
        ("speed_std_rad_s", "speed_rad_s", SensorError(absolute=0.02)),
        ("speed_rad_s_std", "speed_rad_s", SensorError(absolute=0.02)),
        ("speed_relative_std", "speed_rad_s", SensorError(relative=0.02)),
        ("load_relative_std", "load_N", SensorError(relative=0.02)),
        ("load_N_relative_std", "load_N", SensorError(relative=0.02)),
        ("opening_std", "opening", SensorError(absolute=0.02)),
        ("oil_temperature_std_degC", "oil_temperature_degC", SensorError(absolute=0.02)),
    ],
)
def test_a_key_names_a_column_with_its_unit_last_or_left_out(key: str, column: str, error: SensorError) -> None:
    """As the keys of `rover-wheel`; a column that only `covariates` reads is named in full."""
    assert sensors(**{key: 0.02})[column] == error


def test_what_the_class_states_is_replaced_by_column() -> None:
    """Other columns keep the class's errors, and one column may have both kinds."""
    assert sensors(opening_std=0.1) == {"load_N": SensorError(relative=0.5), "opening": SensorError(absolute=0.1)}
    assert sensors(load_std_N=1.0, load_relative_std=0.1)["load_N"] == SensorError(0.1, 1.0)
    assert Joint.from_tables({}).sensors is Joint.sensors


def test_a_parameter_of_that_name_and_a_table_of_the_users_own_come_first() -> None:
    """Files that had a table of this name before are read as they were."""
    made = Joint.from_tables({"sensors": {"speed_std": 2.0}})
    assert (made.parameters["speed_std"].value, made.sensors) == (2.0, Joint.sensors)
    assert OwnTable.from_tables({"sensors": {"height_m": 3}}).sensors is Joint.sensors


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("speed_error", 0.1, r"\[sensors\] speed_error is no standard deviation .* write speed_std_rad_s = 0.02"),
        ("speed_std_rad_s", "small", r"\[sensors\] speed_std_rad_s: a finite number is needed, not 'small'"),
        ("speed_std_rad_s", -0.1, r"\[sensors\] speed_std_rad_s: a standard deviation is 0 \(exact\) or more"),
    ],
)
def test_a_mistake_is_told_with_the_cure(key: str, value: object, told: str) -> None:
    """One message, with the key."""
    with pytest.raises(SimulationError, match=told) as caught:
        sensors(**{key: value})
    assert caught.value.keys == ("sensors", key)


def test_a_column_that_nobody_recorded_is_noted() -> None:
    """It may be misspelt, or a recording lacks the sensor; what the class states is not noted."""
    time_s = np.arange(5.0)
    columns = dict.fromkeys(("torque_Nm", "speed_rad_s", "load_N", "opening"), time_s + 1)
    recording = from_columns({"t_s": time_s, **columns})
    made = checked(Joint.from_tables({"sensors": {"sped_std_rad_s": 0.02}}))
    (note,) = made.prepare(recording).notes[len(recording.notes) :]
    assert note.startswith("[sensors] states an error of sped_rad_s, a column that nobody recorded; did you mean")
    assert checked(Joint.from_tables({})).prepare(recording).notes == recording.notes
