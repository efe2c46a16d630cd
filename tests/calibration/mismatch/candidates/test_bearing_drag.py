"""Drag of one wheel is bearing drag where it was not there at first, and friction where it was."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from winch import Winch

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Effect

    Array = NDArray[np.float64]

ROWS, STEP_S = 2000, 0.5


def found_with(seed: int, onset_s: float) -> Effect:
    """Return what is named where drum 2 drags from a time on."""
    generator = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(ROWS)[:, None]
    phase = time_s / 20 + np.array([0.0, 1.0]) + generator.uniform(0, 6)
    speed, pull = np.sin(phase) + 0.5 * np.sin(2.7 * phase), 40 + 15 * np.sin(phase / 3)
    drag = 0.3 * np.sign(speed) * (time_s >= onset_s) * np.array([0.0, 1.0])
    columns = {"current_A": 0.02 * pull + drag + generator.normal(0, 0.3, speed.shape), "speed": speed, "pull_N": pull}
    table = {"t_s": np.repeat(time_s, 2), "drum": np.tile([1.0, 2.0], ROWS)}
    recording = from_columns({**table, **{name: values.ravel() for name, values in columns.items()}}, unit="drum")
    (effect,) = compare(recording, Winch()).answer.effects
    assert effect.wheels == (2,)
    return effect


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_drag_from_the_start_on_one_wheel_is_its_friction(seed: int) -> None:
    """No onset within the first seconds makes a fault of it."""
    effect = found_with(seed, 0.0)
    assert (effect.name, effect.onset_s) == ("coulomb-friction", None)


@pytest.mark.parametrize("onset_s", [100.0, 500.0])
def test_drag_that_begins_later_is_bearing_drag_with_its_onset(onset_s: float) -> None:
    """Its interval holds the true onset, and stays where an onset is looked for."""
    effect = found_with(3, onset_s)
    assert effect.name == "bearing-drag"
    onset = effect.parameters["onset_s"]
    assert 0.05 * ROWS * STEP_S - STEP_S <= onset.low < onset_s < onset.high
