"""Drives at which a simulation predicts nothing, or no finite number: they tell nothing apart, and raise nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import Drag, Level, Power, equations_of, table, term_of

from regolithd.calibration.mismatch import from_columns
from regolithd.calibration.mismatch.experiments.choice import Choice, experimenter_of
from regolithd.calibration.mismatch.experiments.drives import SPEED, UNLOADED, Drives
from regolithd.calibration.mismatch.experiments.margins import of_effect
from regolithd.calibration.mismatch.experiments.settings import settings_of
from regolithd.calibration.mismatch.problem.build import build_problem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.problem.problem import Problem

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
USUAL = 2.1


class Still(Level):
    """A machine that predicts nothing below half its usual speed, and whose parts without load are such."""

    unloaded_experiment = "take the load off"
    experiment_spans: ClassVar = {"wheel_speed": 2.0}
    below, beyond = 0.5 * USUAL, np.nan

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the level; at slow speeds what is beyond it."""
        slow = np.abs(inputs["speed_rad_s"]) < self.below
        return values["level"] * np.where(slow, self.beyond, 1.0)


class Undefined(Still):
    """One that predicts nothing at any other speed than the recorded."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the level at the recorded speed alone."""
        return values["level"] * np.where(inputs["speed_rad_s"] == USUAL, 1.0, np.nan)


class Overflowing(Still):
    """One whose prediction is too large to be squared where it is slow."""

    below, beyond = USUAL, 1e200


def one_speed(machine: Level) -> Problem:
    """Return the problem of a recording at one speed, on which a drag and a power of the speed are one."""
    columns = table(drag=0.3)
    noise = columns["reading_V"] - 2.0 - 0.3 * np.sign(columns["speed_rad_s"])
    columns = {**columns, "speed_rad_s": np.full(len(noise), USUAL), "reading_V": 2.3 + noise}
    return build_problem(from_columns(columns, unit="axis"), machine)


def chosen(machine: Level) -> Choice | None:
    """Return the experiment for the two."""
    equations = equations_of(one_speed(machine), (Drag(), Power()))
    hypotheses = [of_effect(equations, (), term_of(equations, name)) for name in ("drag", "power")]
    return experimenter_of(equations, 8.0).choose(hypotheses, ())


def test_readings_without_a_prediction_have_no_part_in_a_drive() -> None:
    """With load or without: at a standstill a class may predict nothing, and what it predicts elsewhere counts."""
    drive = Drives(one_speed(Still()), ["wheel_speed"])(frozenset({SPEED, UNLOADED}))
    slow = np.abs(drive.problem.covariates["wheel_speed"]) < Still.below
    assert slow[drive.loaded[:, 0] == 0].any()
    assert (drive.problem.mask == ~slow).all()
    assert np.isfinite(drive.tangents).all()
    choice = chosen(Still())
    assert choice is not None
    assert choice.margin >= choice.needed


@pytest.mark.parametrize("machine", [Undefined(), Overflowing()])
def test_a_drive_that_cannot_be_predicted_is_no_experiment(machine: Level) -> None:
    """Neither does it raise."""
    choice = chosen(machine)
    assert choice is None or SPEED not in choice.varied


def test_the_size_of_a_speed_has_no_sign() -> None:
    """A span that reaches beyond a standstill does not lower the slowest speed that an experiment sets."""

    class Far(Still):
        experiment_spans: ClassVar = {"wheel_speed": 3.0}

    found = settings_of(one_speed(Far()), ["wheel_speed"])["wheel_speed"]
    assert (found.low, found.high) == (pytest.approx(USUAL / 2), pytest.approx(USUAL + 3.0))
