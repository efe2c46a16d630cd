"""A periodic course in the phase that a residual shows."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.signal.phase import shifted_to

PLACES = np.array([[0, 1, 4, 5], [2, 3, 6, 7]])
"""Two wheels: cosine and sine of the first, of the second, then the overtones."""


def columns(angle: np.ndarray) -> np.ndarray:
    """Return the columns of two wheels, with overtone, for angles (time, wheel)."""
    found = np.zeros((8, *angle.shape))
    for wheel, places in enumerate(PLACES):
        for sine, (cosine, sinus) in enumerate(places.reshape(-1, 2), 1):
            found[cosine, :, wheel] = np.cos(sine * angle[:, wheel])
            found[sinus, :, wheel] = np.sin(sine * angle[:, wheel])
    return found


@pytest.mark.parametrize("size", [1.0, 2.5])
def test_a_course_that_begins_elsewhere_is_followed(size: float) -> None:
    """Each wheel by its own angle, whatever its size is now, and with the form that it had."""
    rng = np.random.default_rng(0)
    angle = np.cumsum(rng.uniform(0.1, 0.4, (2000, 2)), axis=0)
    coefficients = np.array([1.0, 0.5, -0.3, 0.8, 0.2, -0.1, 0.3, 0.1])
    begins = np.array([0.7, 4.0])
    residual = size * np.einsum("c,ctw->tw", coefficients, columns(angle + begins)) + rng.normal(0, 0.3, angle.shape)
    here = shifted_to(residual, columns(angle), coefficients, PLACES)
    expected = np.einsum("c,ctw->tw", coefficients, columns(angle + begins))
    assert np.einsum("c,ctw->tw", here, columns(angle)) == pytest.approx(expected, abs=0.1)
    assert np.hypot(here[0::2], here[1::2]) == pytest.approx(np.hypot(coefficients[0::2], coefficients[1::2]))
