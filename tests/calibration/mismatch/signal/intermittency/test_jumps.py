"""Jumps of the level of a course, which noise of no spectrum has."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from regolithd.calibration.mismatch.signal.intermittency.jumps import jumps, levels

Array = NDArray[np.float64]
COUNT = 1800


def noise(seed: int, memory: float, white: float, count: int = COUNT) -> Array:
    """Return noise with a memory of so many readings, and white noise beside it."""
    random, kept = np.random.default_rng(seed), np.exp(-1 / memory)
    slow = lfilter([np.sqrt(1 - kept**2)], [1, -kept], random.standard_normal(count + 5000))[5000:]
    return np.asarray(slow + white * random.standard_normal(count))


@pytest.mark.parametrize("memory", [3.0, 30.0, 300.0])
@pytest.mark.parametrize("white", [0.1, 0.5, 1.0])
def test_noise_of_any_memory_has_no_jump(memory: float, white: float) -> None:
    """Of twenty courses none."""
    assert not any(jumps(noise(seed, memory, white)).size for seed in range(20))


def test_begin_and_end_of_spells_are_found_within_two_readings() -> None:
    """Beside slow noise of the size of a third of a spell."""
    course, at = noise(1, memory=300.0, white=0.3), np.array([480, 750, 990, 1065, 1400, 1610])
    for first, end in at.reshape(-1, 2):
        course[first:end] += 7.0
    found = jumps(course)
    assert found.size == at.size
    assert np.all(np.abs(found - at) <= 2)
    assert np.var(levels(course, found)) > 0.8 * np.var(course)


def test_single_readings_are_no_jump() -> None:
    """One reading, or two in a row, move no median of five."""
    course = noise(2, memory=3.0, white=0.5)
    course[[200, 201, 700, 1300, 1301]] += 40.0
    assert not jumps(course).size


def test_rounded_readings_do_not_jump_by_what_they_are_rounded_to() -> None:
    """A slow course that is rounded to its own size is flat between steps, and what is left of it jumps."""
    slow = 4 * np.sin(np.arange(COUNT) / 150)
    left = np.round((slow + 0.1 * noise(3, memory=3.0, white=1.0)) / 3) * 3 - slow
    assert jumps(left).size
    assert not jumps(left, least=6.0).size


def test_slow_noise_that_turns_round_does_not_jump() -> None:
    """Read along a motion that reverses, or across a gap of an hour, it is another noise after that."""
    course, breaks = 5 * noise(4, memory=300.0, white=0.02), np.arange(120, COUNT, 120)
    along = np.repeat([1.0, -1.0], 120)[np.arange(COUNT) % 240]
    assert jumps(course * along).size
    assert not jumps(course * along, breaks).size


def test_a_short_or_constant_course_has_none() -> None:
    """Nothing is asked of what cannot show it."""
    assert not jumps(np.zeros(COUNT)).size
    assert not jumps(np.repeat([0.0, 9.0], 20)).size
