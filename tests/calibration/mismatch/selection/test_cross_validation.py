"""What a term gains must come back on data that did not fit it, and in more than one run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.prior import Prior
from regolithd.calibration.mismatch.simulation.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.simulation.simulation import Array


class Still(Simulation):
    """A reading that should be constant, while something turns."""

    channel, unit = "reading_V", "V"
    inputs = ("speed_rad_s",)
    parameters: Mapping[str, Prior] = {"level": Prior(1.0, 1.0, "V")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the level."""
        return values["level"] + 0 * inputs["speed_rad_s"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rad_s"], "time": inputs["t_s"]}


def named_when(drag_of_run: list[float]) -> set[str]:
    """Return what is named where each run has a drag of its own, under white noise."""
    rng = np.random.default_rng(4)
    instants = 1500
    run = np.repeat(np.arange(len(drag_of_run)), instants)
    t_s = np.tile(np.arange(instants) * 0.2, len(drag_of_run))
    speed = np.where(np.sin(t_s / 9 + run) > 0, 0.3, -0.3)
    reading = 1 + np.asarray(drag_of_run)[run] * np.sign(speed) + 0.3 * rng.normal(size=len(run))
    columns = {"t_s": t_s, "run": run, "speed_rad_s": speed, "reading_V": reading}
    recording = from_columns({name: np.asarray(values, np.float64) for name, values in columns.items()})
    return {effect.name for effect in compare(recording, Still()).answer.effects}


def test_a_drag_that_every_run_has_is_named() -> None:
    """The same in six runs: a property of the machine."""
    assert len(named_when([0.1] * 6)) == 1


def test_a_drag_of_one_run_is_no_property_of_the_machine() -> None:
    """One run of six shows it, the others do not: an occasion, not a finding."""
    assert named_when([0.0, 0.25, 0.0, 0.0, 0.0, 0.0]) == set()
