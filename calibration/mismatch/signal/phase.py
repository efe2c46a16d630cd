"""The phase of a periodic course that is known but for where it begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PHASES = 720
"""Phases that are tried (a choice: half a degree changes nothing of a ripple)."""


def shifted_to(residual: Array, columns: Array, coefficients: Array, of_wheels: NDArray[np.int64]) -> Array:
    """Return the coefficients of sines, shifted on each wheel to the phase in which a residual follows them most.

    The overtone moves by twice the angle of the fundamental: the course keeps its form.

    Parameters
    ----------
    residual: shape (time, wheel)
    columns: cosines and sines, shape (column, time, wheel)
    coefficients: of these, shape (column,)
    of_wheels: places of the cosine and sine of each wheel, then of its overtone, shape (wheel, column)
    """
    found, phases = coefficients.copy(), 2 * np.pi * np.arange(PHASES) / PHASES
    for wheel, places in enumerate(of_wheels):
        about = residual[:, wheel] - residual[:, wheel].mean()
        pairs = places.reshape(-1, 2)
        follows = np.zeros(PHASES)
        for sine, (cosine, sinus) in enumerate(pairs, 1):
            turned = _turned(coefficients[cosine], coefficients[sinus], sine * phases)
            follows += turned[0] * (about @ columns[cosine, :, wheel]) + turned[1] * (about @ columns[sinus, :, wheel])
        best = float(phases[np.argmax(follows)])
        for sine, (cosine, sinus) in enumerate(pairs, 1):
            found[cosine], found[sinus] = _turned(coefficients[cosine], coefficients[sinus], sine * best)
    return found


def _turned(cosine: float, sine: float, phase: Array | float) -> tuple[Array, Array]:
    """Return the coefficients of a cosine and a sine whose argument is larger by a phase."""
    return (
        np.asarray(cosine * np.cos(phase) + sine * np.sin(phase)),
        np.asarray(sine * np.cos(phase) - cosine * np.sin(phase)),
    )
