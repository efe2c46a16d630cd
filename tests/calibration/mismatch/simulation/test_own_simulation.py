"""Anyone's simulation: a class of a few lines, named in SIM.toml, compared without touching the tool."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.errors import RecordingError, SimulationError
from regolithd.calibration.mismatch.simulation.load import load_simulation

HERE = Path(__file__).parents[3] / "bench"
TABLES = {"simulation": {"model": "servo:ServoAxis"}, "parameters": {"mass_kg": {"value": 96.0, "std": 1.0}}}


def test_a_servo_axis_lacks_friction() -> None:
    """Coulomb and viscous friction, added to mass × acceleration, are both named."""
    rng = np.random.default_rng(4)
    t = np.arange(0, 60, 0.02)
    speed = 0.1 * np.sin(2 * np.pi * t / 3) * (1 + 0.5 * np.sin(t / 7))
    acceleration = np.gradient(speed, t)
    force = 95 * acceleration + 20 * np.sign(speed) + 200 * speed + rng.normal(0, 5, len(t))
    table = {"t_s": t, "speed_m_s": speed, "acceleration_m_s2": acceleration, "force_N": force}
    answer = compare(from_columns(table, unit="axis"), load_simulation(TABLES, beside=HERE)).answer
    assert {e.name for e in answer.effects} == {"coulomb-friction", "viscous-friction"}
    assert all(e.wheels == (1,) and e.channel == "force_N" for e in answer.effects)


def test_a_recording_without_what_is_predicted_is_refused() -> None:
    """The message names the column."""
    table = {"t_s": np.arange(200.0), "acceleration_m_s2": np.ones(200)}
    with pytest.raises(RecordingError, match="force_N"):
        compare(from_columns(table, unit="axis"), load_simulation(TABLES, beside=HERE))


@pytest.mark.parametrize(
    "tables",
    [
        {},
        {"simulation": {"model": "no-such-model"}},
        {"simulation": {"model": "no.such.module:Class"}},
        {"simulation": {"model": "servo:Absent"}},
        {"simulation": {"model": "servo:ServoAxis"}, "soil": {"weight": 1.0}},
        {"simulation": {"model": "servo:ServoAxis"}, "parameters": {"weight": {"value": 1.0}}},
        {"simulation": {"model": "rover-wheel"}, "soil": {"cohesion_Pa": -1}},
    ],
)
def test_a_wrong_description_is_refused_with_a_reason(tables: dict[str, object]) -> None:
    """One error, before anything is computed."""
    with pytest.raises(SimulationError, match=r"."):
        load_simulation(tables, beside=HERE)
