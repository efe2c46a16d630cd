"""A corrected ripple against a later recording, whose integrated angle begins elsewhere on the machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.corrected import write_corrected
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Array = NDArray[np.float64]

MODULE = """
from regolithd.calibration.mismatch import Prior, Simulation

class Pump(Simulation):
    channel, unit = "motor_A", "A"
    inputs = ("speed_rad_s",)
    parameters = {"level_A": Prior(2.0, 0.1, "A")}

    def predict(self, inputs, values):
        return values["level_A"] + 0.1 * inputs["speed_rad_s"]

    def covariates(self, inputs):
        return {"wheel_speed": inputs["speed_rad_s"]}
"""


def pumped(seed: int, begin_rad: float, amplitude: float) -> Mapping[str, Array]:
    """Return a recording of a pump head that stands somewhere when it begins."""
    rng, rows = np.random.default_rng(seed), 2000
    time_s = 0.05 * np.arange(rows)
    speed = 3 + np.sin(time_s / 7 + seed) + 0.5 * np.sin(time_s / 2)
    angle = begin_rad + np.concatenate(([0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 0.05)))
    current = 2.02 + 0.1 * speed + amplitude * np.cos(3 * angle) + rng.normal(0, 0.05, rows)
    return {"t_s": time_s, "speed_rad_s": speed, "motor_A": current}


@pytest.fixture(scope="module")
def corrected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a simulation that was corrected by a ripple of 0.15 A."""
    folder = tmp_path_factory.mktemp("pump")
    (folder / "pump_head.py").write_text(MODULE)
    (folder / "SIM.toml").write_text('[simulation]\nmodel = "pump_head:Pump"\n')
    found = compare(pumped(1, 0.0, 0.15), load_simulation(folder / "SIM.toml"))
    assert [effect.name for effect in found.answer.effects] == ["wheel-angle-ripple"]
    write_corrected(folder / "NEW.toml", found.answer, found.evidence, found.simulation)
    return folder / "NEW.toml"


@pytest.mark.parametrize("begin_rad", [0.0, 0.4, 1.1])
def test_unchanged_it_is_consistent_wherever_the_recording_begins(corrected: Path, begin_rad: float) -> None:
    """The phase is that of the recording."""
    assert compare(pumped(2, begin_rad, 0.15), load_simulation(corrected)).answer.verdict == "consistent"


@pytest.mark.parametrize("amplitude", [0.3, 0.0])
def test_its_size_is_compared(corrected: Path, amplitude: float) -> None:
    """Twice as large, and gone."""
    answer = compare(pumped(3, 1.1, amplitude), load_simulation(corrected)).answer
    assert answer.verdict == "missing-physics"
    (change,) = answer.changes
    assert change.now == pytest.approx(amplitude, abs=0.02)
