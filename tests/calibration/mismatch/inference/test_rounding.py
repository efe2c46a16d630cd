"""Values and intervals as text."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.inference.rounding import with_interval


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ((0.015093, 0.009539, 0.01955), ("0.015", "0.010", "0.020")),
        ((0.01509, 0.01439, 0.01554), ("0.0151", "0.0144", "0.0155")),
        ((19.2, 19.197, 19.2031), ("19.2000", "19.1970", "19.2031")),
        ((15234.0, 12017.0, 18411.0), ("15234", "12017", "18411")),
        ((-0.0004, -0.03, 0.03), ("0.000", "-0.030", "0.030")),
        ((1.349e-7, 7.79e-8, 1.92e-7), ("1.3e-07", "7.8e-08", "1.9e-07")),
        ((2.5e9, 2.41e9, 2.62e9), ("2.5e+09", "2.41e+09", "2.62e+09")),
    ],
)
def test_the_interval_decides_how_many_places_are_shown(
    numbers: tuple[float, float, float], expected: tuple[str, str, str]
) -> None:
    """Two digits of its width, and the value rounded to the same place."""
    assert with_interval(*numbers) == expected


def test_a_value_without_an_interval_has_four_digits() -> None:
    """Its ends are NaN, or the value itself."""
    assert with_interval(1.23456, np.nan, np.nan) == ("1.235", "nan", "nan")
    assert with_interval(1.23456, 1.23456, 1.23456) == ("1.235", "1.235", "1.235")
