"""Noise of which a part wanders."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from numpy.typing import NDArray

READINGS = 6000


def noise(time: float, seed: int, white: float = 0.5) -> NDArray[np.float64]:
    """Return noise of variance 1 of which a part has this correlation time [readings], shape (reading,)."""
    rng = np.random.default_rng(seed)
    kept = np.exp(-1 / time)
    slow = lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.standard_normal(READINGS + 2000))[2000:]
    return np.asarray(np.sqrt(white) * rng.standard_normal(READINGS) + np.sqrt(1 - white) * slow)
