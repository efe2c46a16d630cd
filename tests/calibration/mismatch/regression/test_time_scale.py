"""The answer depends on the numbers of a recording, not on how long a row lasts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from winch import Winch

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer

    Array = NDArray[np.float64]

ROWS = 1500


def wound(step_s: float) -> dict[str, Array]:
    """Return the same numbers at another interval: Coulomb friction, and drum 2 drags from two fifths on."""
    generator = np.random.default_rng(11)
    row = np.arange(ROWS)
    phase = np.stack((row / 40, row / 40 + 1.0), axis=1)
    speed = np.sin(phase) + 0.5 * np.sin(2.7 * phase)
    pull = 40 + 15 * np.sin(phase / 3)
    noise = generator.normal(0, 0.1, (ROWS + 4, 2))
    slow = sum(noise[k : k + ROWS] for k in range(5)) / np.sqrt(5)
    dragging = np.sign(speed) * (row[:, None] > 0.4 * ROWS) * np.array([0.0, 1.0])
    current = 0.02 * pull + 0.15 * np.sign(speed) + 0.25 * dragging + slow
    columns = {"current_A": current, "speed": speed, "pull_N": pull}
    return {
        "t_s": np.repeat(step_s * row, 2),
        "drum": np.tile([1.0, 2.0], ROWS),
        **{name: values.ravel() for name, values in columns.items()},
    }


def answer_at(step_s: float) -> Answer:
    """Return what is said of these numbers at an interval."""
    return compare(from_columns(wound(step_s), unit="drum"), Winch()).answer


@pytest.fixture(scope="module")
def each_second() -> Answer:
    """Return the answer with a row each second."""
    return answer_at(1.0)


@settings(max_examples=2, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(step_s=st.floats(0.001, 300.0))
def test_the_same_numbers_have_the_same_answer_at_every_interval(each_second: Answer, step_s: float) -> None:
    """Names, sizes, intervals and held-out errors are the same; an onset is in proportion to the interval."""
    assert [effect.name for effect in each_second.effects] == ["coulomb-friction", "bearing-drag"]
    answer = answer_at(step_s)
    assert answer.verdict == each_second.verdict
    for now, before in zip(answer.effects, each_second.effects, strict=True):
        assert (now.name, now.wheels) == (before.name, before.wheels)
        size, expected = (each.parameters["relative_size"] for each in (now, before))
        for part in ("value", "low", "high"):
            assert getattr(size, part) == pytest.approx(getattr(expected, part), rel=1e-6)
        if before.onset_s is not None and now.onset_s is not None:
            assert now.onset_s / step_s == pytest.approx(before.onset_s, rel=1e-6)
    assert answer.fit.held_out_rmse_after == pytest.approx(each_second.fit.held_out_rmse_after, rel=1e-6)
