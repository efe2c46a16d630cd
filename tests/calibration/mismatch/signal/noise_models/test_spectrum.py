"""The spectrum of sums over places: a line is found where it is."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.noise_models.spectrum import ZERO_PADDING, padded_length, power_of_sums


@pytest.mark.parametrize(("last", "length"), [(0, 8), (6, 32), (7, 64), (1000, 4096)])
def test_transforms_have_a_padded_power_of_two(last: int, length: int) -> None:
    """At least as many places as there are, times the padding."""
    assert padded_length(last) == length
    assert length >= ZERO_PADDING * (last + 1)


def test_a_sine_has_its_power_at_its_frequency() -> None:
    """Between two resolved frequencies too."""
    place = np.arange(1000)
    length = padded_length(999)
    power = power_of_sums(place, np.sin(2 * np.pi * 0.0613 * place), length)
    assert np.argmax(power) / length == pytest.approx(0.0613, abs=0.5 / length)


def test_values_on_one_place_are_summed() -> None:
    """Two halves are a whole."""
    one = power_of_sums(np.array([3, 5]), np.array([1.0, 2.0]), 16)
    halves = power_of_sums(np.array([3, 3, 5, 5]), np.array([0.5, 0.5, 1.0, 1.0]), 16)
    np.testing.assert_allclose(one, halves)
    assert one[0] == pytest.approx(9.0)
