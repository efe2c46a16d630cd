"""The noise of a monitored recording: estimated from the latest residuals, each left by what was known before it."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel, estimate_noise

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.online.sums import Interval

Array = NDArray[np.float64]


class NoiseHistory:
    """Residuals of the latest `most` intervals."""

    def __init__(self, most: int) -> None:
        self._kept: deque[tuple[Array, NDArray[np.bool_]]] = deque(maxlen=most)

    def add(self, interval: Interval, coefficients: Array) -> None:
        """Add what coefficients, shape (column, wheel), leave of an interval."""
        self._kept.append((interval.left_by(coefficients), interval.mask))

    def drop_last(self) -> None:
        """Forget the interval that was added last."""
        self._kept.pop()

    def clear(self) -> None:
        """Forget all of them."""
        self._kept.clear()

    def model(self) -> NoiseModel:
        """Return deviation on each wheel and autocorrelation time."""
        left, mask = (np.concatenate(part) for part in zip(*self._kept, strict=True))
        return estimate_noise(left, mask)
