"""A machine that only weighs: names of drivetrains are not given there, and a cell's drift has its own."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.covariates import quantity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer

ROWS, HOPPERS = 3600, (1, 2)


class Hoppers(Simulation):
    """Weight of two hoppers whose filling levels are measured."""

    channel, unit, wheel_column = "load_N", "N", "hopper"
    inputs = ("level_m",)
    parameters: ClassVar = {"weight_N_m": Prior(100.0, 2.0, "N/m")}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the weight."""
        return values["weight_N_m"] * inputs["level_m"]


def answer(curved: float = 0.0, drift_N: float = 0.0, offset_N: float = 0.0) -> Answer:
    """Compare with hoppers that get wider towards the top, of which the second's cell drifts or has an offset."""
    generator = np.random.default_rng(5)
    time_s = np.repeat(np.arange(ROWS, dtype=float), 2)
    hopper = np.tile(HOPPERS, ROWS)
    level = 1.0 + 0.6 * np.sin(2 * np.pi * time_s / 700 + hopper) + 0.3 * np.sin(2 * np.pi * time_s / 190)
    load = 100 * level + curved * level**2 + generator.normal(0, 10, len(level))
    load += np.where(hopper == 2, drift_N * np.clip((time_s - 1500) / 2100, 0, 1), 0)
    load += np.where(hopper == 2, offset_N * -np.expm1(-time_s / 60), 0)
    columns = {"t_s": time_s, "hopper": hopper.astype(float), "level_m": level, "load_N": load}
    return compare(from_columns(columns, unit="hopper"), Hoppers()).answer


def test_weight_is_no_torque() -> None:
    """A hopper's curved wall is located over the load; no gear loses anything there."""
    found = answer(curved=30.0)
    assert found.effects == ()
    assert [term.covariate for term in found.unexplained] in (["load"], ["level"])


def test_a_drifting_cell_is_named_with_its_onset_and_size() -> None:
    """The reading of one hopper's cell that creeps away is found, from when and how far."""
    (effect,) = answer(drift_N=25.0).effects
    assert (effect.name, effect.wheels, effect.channel) == ("load-cell-drift", (2,), "load_N")
    assert effect.onset_s == pytest.approx(1500, abs=360)
    drift = effect.parameters["drift"]
    assert drift.low < 25.0 < drift.high


@pytest.mark.parametrize("offset_N", [4.0, 8.0])
def test_an_offset_that_was_there_from_the_beginning_is_no_drift(offset_N: float) -> None:
    """It is reached within the first two per cent of the recording, and has no name: it stays unexplained."""
    found = answer(offset_N=offset_N)
    assert found.effects == ()
    assert found.verdict == "unexplained"


@pytest.mark.parametrize(
    ("channel", "name"),
    [
        ("load_N", "load"),
        ("load_kN", "load"),
        ("flow_m3_s", "flow"),
        ("level", "level"),
        ("supply_voltage_mV", "supply_voltage"),
        ("flow_L_min", "flow"),
        ("oxygen_mg_L", "oxygen"),
        ("speed_L_rad_s", "speed_L"),
    ],
)
def test_a_quantity_is_a_channel_without_its_unit(channel: str, name: str) -> None:
    """The covariate of a prediction has the same name in every unit."""
    assert quantity(channel) == name
