"""Whole answers of short recordings, number by number.

The stored answers were read before they were stored: what was concealed is named, with intervals that hold it. A change
of the engine that moves one of their numbers shows in the diff after `GOLDEN=write pytest …`.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import fleet_arm
import numpy as np
import pytest
import rover_drives
from golden import assert_golden, rounded
from jsonschema import Draft202012Validator

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.answer import answer_schema
from regolithd.calibration.mismatch.data.recording import read_recording
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch import Candidate, Simulation

    Table = dict[str, NDArray[Any]]

GOLDEN = Path(__file__).parent / "golden"
FIGURES = 5
"""Numbers of each curve that are compared."""


class AnyPhysics(fleet_arm.Arm):
    """The arm, with the whole library and a temperature."""

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return what friction follows."""
        return {**super().covariates(inputs), "temperature": inputs["gear_temperature_degC"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return all."""
        return library


def arm(seed: int) -> Table:
    """Return half a minute of an arm that warms up."""
    table = fleet_arm.columns(seed)
    return {**table, "gear_temperature_degC": -20.0 + 30.0 * (1 - np.exp(-table["t_s"] / 12))}


def with_friction() -> Table:
    """Return an arm with Coulomb and viscous friction on both joints."""
    table = arm(1)
    drag = 0.15 * np.sign(table["speed_rad_s"]) + 0.1 * table["speed_rad_s"]
    return {**table, "torque_Nm": table["torque_Nm"] + drag}


def with_worn_wrist() -> Table:
    """Return an arm whose wrist drags from half of the time on."""
    table = arm(2)
    worn = 0.2 * np.sign(table["speed_rad_s"]) * ((table["axis"] == "wrist") & (table["t_s"] > 14))
    return {**table, "torque_Nm": table["torque_Nm"] + worn}


def with_cold_lubricant() -> Table:
    """Return an arm whose friction falls as it warms up."""
    table = arm(3)
    drag = 0.1 * np.exp(-table["gear_temperature_degC"] / 10) * np.sign(table["speed_rad_s"])
    return {**table, "torque_Nm": table["torque_Nm"] + drag}


def with_a_hump() -> Table:
    """Return an arm with a torque that has its largest value at half speed both ways, as no candidate has it."""
    table = arm(4)
    hump = 0.4 * np.cos(5 * table["speed_rad_s"])
    return {**table, "torque_Nm": table["torque_Nm"] + hump}


def rover(seed: int) -> Table:
    """Return a minute of a rover, without anything missing."""
    return rover_drives.columns(seed, length_s=60.0)


def with_drag_of_one_wheel() -> Table:
    """Return a rover whose wheel 4 drags."""
    table = rover(5)
    size = 0.4 * np.mean(np.abs(table["motor_current_A"])) * (table["wheel"] == 4)
    return {**table, "motor_current_A": table["motor_current_A"] + size * np.sign(table["motor_speed_rad_s"])}


@pytest.mark.parametrize(
    ("recorded", "simulation"),
    [
        (lambda: arm(0), AnyPhysics),
        (with_friction, AnyPhysics),
        (with_worn_wrist, AnyPhysics),
        (with_cold_lubricant, AnyPhysics),
        (with_a_hump, AnyPhysics),
        (lambda: rover(6), rover_drives.simulation),
        (with_drag_of_one_wheel, rover_drives.simulation),
    ],
    ids=["arm", "friction", "worn-wrist", "cold-lubricant", "hump", "rover", "drag-of-one-wheel"],
)
def test_an_answer_is_the_reviewed_one(
    recorded: Callable[[], Table], simulation: Callable[[], Simulation], request: pytest.FixtureRequest
) -> None:
    """Names, sizes, intervals, rivals, sensitivities, parameters and notes; and the curves and maps of the report."""
    found = compare(recorded(), simulation())
    evidence = found.evidence
    curves = {
        f"{curve.covariate} {curve.coupling}": [summary(values) for values in (curve.at, curve.before, curve.after)]
        for curve in evidence.curves
    }
    maps = [summary(values.ravel()) for values in (evidence.map_before, evidence.map_after, evidence.before)]
    content = {**found.answer.to_json(), "curves": curves, "maps": maps}
    told = json.dumps(rounded(content), indent=1, ensure_ascii=False)
    assert_golden(told + "\n", GOLDEN / f"{request.node.callspec.id}.json")


def summary(values: NDArray[np.float64]) -> list[float]:
    """Return a few values of an array, evenly spread."""
    return [float(values[int(place)]) for place in np.linspace(0, len(values) - 1, FIGURES)]


@pytest.mark.parametrize("name", ["nothing", "bearing-drag"])
def test_trial_is_answered_as_its_truth(shared_folder: Path, name: str) -> None:
    """Exact names, exact wheels, onset within a tenth of the length."""
    trials = shared_folder / "trials"
    truth = json.loads((trials / f"{name}.truth.json").read_text())["effects"]
    simulation = load_simulation(tomllib.loads((trials / f"{name}.toml").read_text()))
    answer = compare(read_recording(trials / f"{name}.csv.gz"), simulation).answer
    assert answer.verdict == ("missing-physics" if truth else "consistent")
    assert [(e.name, list(e.wheels)) for e in answer.effects] == [(t["name"], t["wheels"]) for t in truth]
    for effect, true in zip(answer.effects, truth, strict=True):
        assert effect.onset_s == pytest.approx(true["time_s"], abs=180)
    plain = json.loads(json.dumps(answer.to_json(), allow_nan=False))
    assert not list(Draft202012Validator(answer_schema()).iter_errors(plain))
