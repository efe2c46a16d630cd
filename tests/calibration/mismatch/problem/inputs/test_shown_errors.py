"""Errors of inputs that the readings show are taken; what the input did is not."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, SensorError, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.inputs.shown_errors import _by_scatter, scatter
from regolithd.calibration.mismatch.problem.simulated import inputs_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

COUNT, ERROR_N = 3000, 3.0


class Slide(Simulation):
    """The current of a drive in proportion to its load."""

    channel, unit = "current_A", "A"
    inputs = ("load_N",)
    parameters: ClassVar = {"gain_A_N": Prior(0.05, 0.002, "A/N")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current."""
        return values["gain_A_N"] * inputs["load_N"]


def stated(error_N: float | None) -> Slide:
    """Return the simulation with this error of the load, or with none stated."""
    found = Slide()
    found.sensors = {} if error_N is None else {"load_N": SensorError(absolute=error_N)}
    return found


def recorded(seed: int, *, felt: bool) -> Recording:
    """Return a slow load with scatter that is either the sensor's or felt by the drive."""
    random = np.random.default_rng(seed)
    slow = 100 + 40 * np.sin(np.arange(COUNT) / 30) * np.sin(np.arange(COUNT) / 111)
    scattered = slow + ERROR_N * random.normal(size=COUNT)
    current = 0.051 * (scattered if felt else slow) + 0.1 * random.normal(size=COUNT)
    return from_columns({"t_s": np.arange(COUNT) * 0.1, "load_N": scattered, "current_A": current})


def test_scatter_is_white_noise_and_neither_steps_nor_slow_courses() -> None:
    """Of a column that is set, or rounded, it is 0."""
    random, time, run = np.random.default_rng(3), np.arange(COUNT) * 0.1, np.zeros(COUNT, np.int64)
    noise = random.normal(size=(COUNT, 2))
    steps = np.repeat(random.uniform(0, 100, COUNT // 20), 20)[:, None]
    assert scatter(noise + steps + np.linspace(0, 50, COUNT)[:, None], time, run) == pytest.approx(1.0, rel=0.15)
    assert scatter(steps, time, run) == 0
    swing = 100 * np.sin(np.arange(COUNT) / 12)[:, None]  # its second differences are as large as those of the noise
    assert scatter(noise + swing, time, run) == pytest.approx(1.0, rel=0.15)
    strokes = 30 * np.sin(np.arange(COUNT) / 0.7)[:, None]  # four readings each: so are its differences of any order
    assert scatter(noise + swing + strokes, time, run) == pytest.approx(1.0, rel=0.15)


@pytest.mark.parametrize("said", [None, 1.5])
def test_the_error_that_the_readings_show_is_taken_and_told(said: float | None) -> None:
    """Where none is stated, and where half of it is."""
    inputs = inputs_of(recorded(1, felt=False), stated(said))
    of_statement = f"a stated error of {said:.2g}" if said else "no stated error"
    (note,) = inputs.expected.notes
    assert re.match(
        rf"load_N has {of_statement}\. Its readings scatter by (2\.[89]|3) \(one standard deviation\)", note
    )
    assert inputs.doubt is not None
    left = inputs.expected.channels["load_N"] - inputs.as_read.channels["load_N"]
    assert float(np.std(left)) > 0.7 * ERROR_N


def test_what_the_drive_feels_is_no_error() -> None:
    """The current follows the scatter of the load; and a right statement is asked no further."""
    recording = recorded(1, felt=True)
    inputs = inputs_of(recording, Slide())
    np.testing.assert_array_equal(inputs.expected.channels["load_N"], recording.channels["load_N"])
    assert inputs.expected.notes == ()
    assert inputs_of(recorded(1, felt=False), stated(ERROR_N)).expected.notes == ()


def test_an_input_that_is_stated_to_be_exact_is_taken_as_it_was_read() -> None:
    """Also where it predicts better with an error."""
    recording = recorded(1, felt=False)
    inputs = inputs_of(recording, stated(0.0))
    np.testing.assert_array_equal(inputs.expected.channels["load_N"], recording.channels["load_N"])
    assert inputs.expected.notes == ()


class Heated(Simulation):
    """A block whose temperature follows the power of its burner, and loses heat."""

    channel, unit = "block_degC", "degC"
    inputs = ("burner_kW",)
    parameters: ClassVar = {"loss": Prior(0.02, 0.001, "1/s")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the temperature, from the first reading on."""
        found = np.array(inputs["block_degC"])
        for k in range(1, len(found)):
            found[k] = found[k - 1] + 0.01 * inputs["burner_kW"][k - 1] - values["loss"] * found[k - 1]
        return found


@pytest.mark.parametrize(("lost", "late"), [(0.0, 0), (0.03, 0), (0.0, 3), (0.0, 40)])
@pytest.mark.parametrize("noisy", [False, True])
def test_neither_missing_physics_nor_a_delay_passes_for_an_error(lost: float, late: int, *, noisy: bool) -> None:
    """A burner that changes from reading to reading heats the block; its sensor's noise does not."""
    random = np.random.default_rng(8)
    slow = 400 + 200 * np.sin(np.arange(COUNT) / 70)
    read = slow * (1 + 0.25 * random.normal(size=COUNT))
    heat, block = slow if noisy else read, np.zeros(COUNT)
    block[0] = 200.0
    for k in range(1, COUNT):
        extra = lost * (block[k - 1] / 200) ** 4
        block[k] = block[k - 1] + 0.01 * heat[k - 1] - 0.02 * block[k - 1] - extra
    block += 0.5 * random.normal(size=COUNT)
    columns = {"t_s": np.arange(COUNT) * 1.0, "burner_kW": np.roll(read, late), "block_degC": block}
    notes = inputs_of(from_columns(columns), Heated()).expected.notes
    assert bool(notes) == noisy


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_that_nobody_stated_is_no_physics(seed: int) -> None:
    """The gain is right, too: an error that is taken as exact makes it seem 2 % smaller."""
    found = compare(recorded(seed, felt=False), Slide()).answer
    assert found.verdict == "consistent"
    (gain,) = found.parameters
    assert gain.value == pytest.approx(0.051, rel=0.005)


def test_a_stated_error_is_not_smaller_by_readings_that_stay_at_zero() -> None:
    """The sun is 0 for more than half of the time, without any error; by day its readings scatter as is stated."""
    random, rows = np.random.default_rng(5), np.arange(COUNT)
    sun = np.maximum(800 * np.sin(rows * 2 * np.pi / 288) - 100, 0.0)
    read = sun * (1 + 0.05 * random.normal(size=COUNT))
    water = np.convolve(sun, np.ones(30) / 30, "same") * 0.01 + 0.05 * random.normal(size=COUNT)
    recording = from_columns({"t_s": rows * 300.0, "load_N": read, "current_A": water})
    sunny = Slide()
    sunny.sensors = {"load_N": SensorError(relative=0.05)}
    assert not [note for note in inputs_of(recording, sunny).expected.notes if "scatter" in note]
    smaller = recording.with_channels(load_N=(sun * (1 + 0.005 * random.normal(size=COUNT)))[:, None])
    assert _by_scatter(smaller.channels["load_N"], smaller.time_s, smaller.run, sunny.sensors["load_N"]) is not None
    assert _by_scatter(recording.channels["load_N"], recording.time_s, recording.run, sunny.sensors["load_N"]) is None
