"""Open-circuit voltage: the bus voltage without the sag that the motors' currents cause.

A supply with an internal resistance sags under the current that it delivers, its noise included. As a covariate such a
voltage would be an effect of the residual, not a cause. The sag is estimated from steps of current and voltage and
added back.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CERTAIN = 5.0
"""Standard errors by which a resistance must differ from 0 (a choice); else the voltage stays as recorded."""

FEWEST = 50
"""Steps below which no resistance is estimated (a choice)."""


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
