"""A late channel and drag with the square of speed are found by name and size on a servo axis."""

from __future__ import annotations

import inspect
import sys
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.delayed import shifted
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer

Array = np.ndarray
STEP_S = 0.02


class Axis(Simulation):
    """Current of a joint: inertia and viscous drag."""

    channel, unit, wheel_column = "motor_current_A", "A", "axis"
    inputs = ("acceleration_rad_s2", "speed_rad_s")
    parameters: ClassVar = {"inertia": Prior(0.5, 0.01, "A s²/rad"), "drag": Prior(0.2, 0.004, "A s/rad")}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the current of inertia and drag."""
        return values["inertia"] * inputs["acceleration_rad_s2"] + values["drag"] * inputs["speed_rad_s"]

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return speed and time."""
        return {"wheel_speed": inputs["speed_rad_s"], "time": inputs["t_s"]}


def swinging(seed: int, quadratic: float = 0.0, delay_s: float = 0.0, coulomb: float = 0.0) -> Recording:
    """Return 100 s of a joint that swings, under autocorrelated noise of a tenth of the mean current."""
    generator = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(5000)
    waves = [(generator.uniform(0.05, 0.8), generator.uniform(0.2, 1), generator.uniform(0, 6)) for _ in range(6)]
    angle = sum(size * np.sin(2 * np.pi * f * time_s + phase) / (1 + 2 * f) for f, size, phase in waves)
    speed = np.gradient(angle, STEP_S)
    acceleration = np.gradient(speed, STEP_S)
    current = 0.5 * acceleration + 0.2 * speed + quadratic * speed * np.abs(speed) + coulomb * np.sign(speed)
    late = np.interp(time_s - delay_s, time_s, current)
    noise = np.convolve(generator.normal(0, 1, len(time_s) + 7), np.ones(8) / np.sqrt(8), "valid")
    measured = late + 0.1 * np.mean(np.abs(current)) * noise
    channels = {"acceleration_rad_s2": acceleration, "speed_rad_s": speed}
    return from_columns({"t_s": time_s, "motor_current_A": measured, **channels})


def answer_to(recording: Recording) -> Answer:
    """Return what the tool says."""
    return compare(recording, Axis()).answer


@pytest.mark.parametrize("delay_s", [0.04, 0.3])
def test_a_late_current_is_named_with_its_delay(delay_s: float) -> None:
    """Two readings late and fifteen readings late are told with the delay inside the interval or within a reading."""
    found = answer_to(swinging(1, delay_s=delay_s))
    assert [effect.name for effect in found.effects] == ["sensor-delay"]
    assert found.effects[0].parameters["delay_s"].value == pytest.approx(delay_s, abs=STEP_S)


class RoughlyStated(Axis):
    """The same joint, whose parameters are known to a quarter, and stated a quarter too small."""

    parameters: ClassVar = {"inertia": Prior(0.375, 0.125, "A s²/rad"), "drag": Prior(0.15, 0.05, "A s/rad")}


def test_what_a_delay_changes_is_told_of_the_calibrated_simulation() -> None:
    """Its size is that of the simulation as it fits, and a delay of fifteen readings is known to a fraction of one."""
    late = swinging(1, delay_s=0.3)
    (effect,) = compare(late, RoughlyStated()).answer.effects
    delay, size = effect.parameters["delay_s"], effect.parameters["relative_size"]
    on_time, current = swinging(1).channels["motor_current_A"], late.channels["motor_current_A"]
    true = np.sqrt(np.mean((shifted(late, on_time, -0.3) - on_time) ** 2)) / np.mean(np.abs(current))
    assert size.value == pytest.approx(true, rel=0.05)
    assert delay.low < 0.3 < delay.high
    assert delay.high - delay.low < STEP_S


def late_with_friction(seed: int) -> Recording:
    """Return a joint with friction, of which the current is late by a quarter of a second."""
    return swinging(seed, delay_s=0.25, coulomb=0.3)


def test_what_else_acts_is_late_with_the_channel() -> None:
    """Friction that is late by twelve readings has its size, and the parameters stay where they are."""
    found = answer_to(late_with_friction(3))
    effects = {effect.name: effect.parameters for effect in found.effects}
    assert effects.keys() == {"sensor-delay", "coulomb-friction"}
    assert effects["sensor-delay"]["delay_s"].value == pytest.approx(0.25, abs=0.2 * STEP_S)
    friction = effects["coulomb-friction"]["coulomb_current"]
    assert friction.low < 0.3 < friction.high
    assert all(each.prior_stds_away < 2 for each in found.parameters)
    assert found.fit.held_out_rmse_after < 1.02 * found.fit.noise_floor_rmse


def test_a_corrected_delay_makes_a_later_recording_s_friction_late_too(tmp_path: Path) -> None:
    """Nothing has changed in it; with more friction it is that which has grown."""
    (tmp_path / "joint.py").write_text(inspect.getsource(sys.modules[__name__]))
    (tmp_path / "SIM.toml").write_text('[simulation]\nmodel = "joint:Axis"\n')
    first = compare(late_with_friction(3), load_simulation(tmp_path / "SIM.toml"))
    first.write_corrected(tmp_path / "NEW.toml")
    corrected = load_simulation(tmp_path / "NEW.toml")
    assert compare(late_with_friction(4), corrected).answer.verdict == "consistent"
    grown = compare(swinging(5, delay_s=0.25, coulomb=0.5), corrected).answer
    assert grown.effects == ()
    (change,) = grown.changes
    assert change.name == "coulomb-friction"
    assert change.low < 0.5 < change.high


def test_drag_with_the_square_of_speed_is_not_called_viscous() -> None:
    """Its coefficient lies in the 90 % interval."""
    found = answer_to(swinging(2, quadratic=0.12))
    assert [effect.name for effect in found.effects] == ["quadratic-drag"]
    size = found.effects[0].parameters["quadratic_coefficient"]
    assert size.low < 0.12 < size.high


def test_a_shift_stays_within_its_run() -> None:
    """The first run's end is not mixed with the second run's start."""
    time_s = np.tile(np.arange(5.0), 2)
    recording = from_columns({"t_s": time_s, "run": np.repeat([0.0, 1.0], 5), "y": np.arange(10.0)})
    moved = shifted(recording, recording.channels["y"], 1.0)[:, 0]
    np.testing.assert_array_equal(moved, [1, 2, 3, 4, 4, 6, 7, 8, 9, 9])
