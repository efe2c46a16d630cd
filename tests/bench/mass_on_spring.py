"""What follows a course as a mass on a spring does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def behind(course: Array, within: int, step_s: float, frequency_Hz: float, damping: float) -> Array:
    """Return where a mass on a spring is that follows a course (time,) in steps of `step_s`, once in `within` steps."""
    rate, at, speed, shown = 2 * np.pi * frequency_Hz, float(course[0]), 0.0, []
    for k, value in enumerate(course.tolist()):
        if k % within == 0:
            shown.append(at)
        speed += step_s * (rate**2 * (value - at) - 2 * damping * rate * speed)
        at += step_s * speed
    return np.array(shown)
