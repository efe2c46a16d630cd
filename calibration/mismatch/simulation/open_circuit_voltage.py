"""The bus voltage without what the motors themselves do to it.

A supply with a resistance sags under the current that it delivers, and with it under that current's noise. Such a
voltage lies downstream of the residual: offered as it is, it "explains" noise. What the currents did to it from one
instant to the next is taken out; what remains – the open-circuit voltage – may explain something.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CERTAIN = 5.0
"""Standard errors by which a sag must show; a voltage that wanders by itself stays as it was recorded."""

FEWEST = 50
"""Instants below which a resistance is not to be had."""


def open_circuit_voltage(voltage_V: Array, current_A: Array) -> Array:
    """Return the voltage with the supply's sag added back [V], shape (time, wheel).

    The resistance is fitted to steps from one instant to the next, V and Σ|I| alike: there the noise of the currents
    is large, and neither a battery that empties nor an effect that follows the voltage has much to say.
    """
    total_A = np.nansum(np.abs(current_A), axis=1)
    readings = np.isfinite(voltage_V)
    summed_V = np.sum(voltage_V, axis=1, where=readings)
    mean_V = np.divide(summed_V, readings.sum(axis=1), out=np.full(len(total_A), np.nan), where=readings.any(axis=1))
    resistance_ohm = _sag(mean_V, total_A)
    return voltage_V + resistance_ohm * total_A[:, None]


def _sag(voltage_V: Array, total_A: Array) -> float:
    """Return the supply's resistance [Ω], or 0 where none shows."""
    rise_V, rise_A = np.diff(voltage_V), np.diff(total_A)
    known = np.isfinite(rise_V) & np.isfinite(rise_A)
    if known.sum() < FEWEST or not np.any(rise_A[known]):
        return 0.0
    rise_V, rise_A = rise_V[known], rise_A[known]
    square = float(rise_A @ rise_A)
    slope = float(rise_V @ rise_A) / square
    left = rise_V - slope * rise_A
    error = float(np.sqrt(left @ left / len(left) / square))
    return -slope if slope < -CERTAIN * error else 0.0
