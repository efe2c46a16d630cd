"""A late input: once its delay is named, all else is looked for with that input on time."""

from __future__ import annotations

import inspect
import sys
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.candidates.sensor_delay import SensorDelay
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Array = NDArray[np.float64]
COUNT, DELAY_S = 5000, 7.0


class Tram(Simulation):
    """The current of a drive uphill, whose grade comes from a slow barometer."""

    channel, unit = "current_A", "A"
    inputs = ("speed_m_s", "grade")
    one_way = True
    parameters: ClassVar = {
        "weight": Prior(30.0, 1.5, "A s/m"),
        "rolling": Prior(0.02, 0.002, "1"),
        "idle_A": Prior(0.5, 0.03, "A"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return what weight, rolling resistance and electronics take."""
        slope = values["rolling"] + inputs["grade"]
        return values["idle_A"] + values["weight"] * slope * inputs["speed_m_s"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and grade."""
        return {"wheel_speed": inputs["speed_m_s"], "pitch": inputs["grade"]}


def driven(seed: int, delay_s: float = DELAY_S, drag: float = 0.0) -> Recording:
    """Return a drive over hills of which the grade is read late, and the current with quadratic drag."""
    random, t_s = np.random.default_rng(seed), np.arange(COUNT, dtype=np.float64)
    parts = [(random.uniform(0.004, 0.03), random.uniform(0, 6)) for _ in range(8)]
    speed = 3 + sum(0.7 * np.sin(2 * np.pi * f * t_s + phase) for f, phase in parts[:4])
    hills = [(f, phase + 1) for f, phase in parts]

    def grade(at: Array) -> Array:
        return sum((0.012 * np.sin(2 * np.pi * f * at + phase) for f, phase in hills), np.zeros(COUNT))

    current = 0.47 + 30.6 * (0.0193 + grade(t_s)) * speed + drag * speed**2
    noise = 0.25 * random.normal(size=COUNT)
    columns = {"t_s": t_s, "speed_m_s": speed, "grade": grade(t_s - delay_s), "current_A": current + noise}
    return from_columns(columns)


def test_what_else_acts_is_found_beside_a_late_input() -> None:
    """Drag of a tenth of what the delay changes has its name and size, and no parameter takes it up."""
    found = compare(driven(1, drag=0.1), Tram()).answer
    effects = {effect.name: effect.parameters for effect in found.effects}
    assert effects.keys() == {"sensor-delay", "quadratic-drag"}
    delay, drag = effects["sensor-delay"]["delay_s"], effects["quadratic-drag"]["quadratic_coefficient"]
    assert delay.low < DELAY_S < delay.high
    assert delay.value == pytest.approx(DELAY_S, abs=0.3)
    assert drag.low < 0.1 < drag.high
    assert found.unexplained == ()
    assert all(each.prior_stds_away < 2.5 for each in found.parameters)


def test_a_delay_changes_as_much_with_the_input_on_time_as_without() -> None:
    """The residual is that of the simulation as it is; the columns and covariates are those of the input on time."""
    recording, delay = driven(2), SensorDelay()
    late = {"grade": DELAY_S}
    before, problem = build_problem(recording, Tram()), build_problem(recording, Tram(), late=late)
    np.testing.assert_allclose(problem.residual, before.residual)
    within = slice(20, COUNT - 20)  # the ends are held
    shape = {"late": "grade", "input_secant_s": 5.0}
    np.testing.assert_allclose(
        delay.columns(problem, shape)[0, within], delay.columns(before, shape)[0, within], atol=2e-3
    )
    exact = {"late": "grade", "input_secant_s": DELAY_S}
    (column,) = delay.columns(problem, exact)
    np.testing.assert_allclose(column, (problem.filled - before.filled) / DELAY_S)
    assert exact in delay.shapes(problem)
    on_time = driven(2, delay_s=0.0).channels["grade"]
    np.testing.assert_allclose(problem.covariates["pitch"][within], on_time[within], atol=1e-9)
    speed = recording.channels["speed_m_s"]
    tangent = problem.values["weight"] * speed[within]
    np.testing.assert_allclose(problem.tangent("rolling")[within], tangent, rtol=1e-6)


def test_a_corrected_delay_puts_the_input_of_a_later_recording_on_time(tmp_path: Path) -> None:
    """The same is consistent, and drag that is new has its name and size."""
    (tmp_path / "tram.py").write_text(inspect.getsource(sys.modules[__name__]))
    (tmp_path / "SIM.toml").write_text('[simulation]\nmodel = "tram:Tram"\n')
    first = compare(driven(3), load_simulation(tmp_path / "SIM.toml"))
    assert [effect.name for effect in first.answer.effects] == ["sensor-delay"]
    first.write_corrected(tmp_path / "NEW.toml")
    corrected = load_simulation(tmp_path / "NEW.toml")
    assert compare(driven(4), corrected).answer.verdict == "consistent"
    new = compare(driven(5, drag=0.05), corrected).answer
    assert [effect.name for effect in new.effects] == ["quadratic-drag"]
    assert new.changes == ()
    late = compare(driven(6, delay_s=12.0), corrected).answer
    (change,) = late.changes
    assert (change.name, change.parameter) == ("sensor-delay", "delay_s")
    assert change.low < 12.0 < change.high
