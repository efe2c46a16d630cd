"""Whether the zero of what is predicted means anything: nothing is in proportion to a temperature in °C."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]

TEMPERATURES = frozenset({"K", "degC", "°C", "C", "degF", "°F", "F"})
POTENTIALS = frozenset({"V", "mV", "kV", "Pa", "hPa", "kPa", "MPa", "bar", "mbar", "psi", "m", "cm", "mm"})
"""Units of what is measured from a reference: voltages, pressures, levels and positions."""
FAR_FROM_ZERO = 4.0
"""Smallest reading, over how far the readings of an axis reach, from which the zero of a potential is taken for
arbitrary (a choice: an effect of 2 % of the mean, which is none below, is then at least a quarter of the usual swing; a
battery of 370 V moves by 40 V, and a tank that is half full may run dry)."""
WITHIN = (0.05, 0.95)
"""Quantiles between which the readings reach."""


def zero_is_arbitrary(simulation: Predictor, measured: Array) -> bool:
    """Return whether nothing is in proportion to the predicted channel, of which these readings (time, wheel) are.

    As the simulation states; else of temperatures, and of potentials that are far from zero on every axis.
    """
    if simulation.zero_means_nothing is not None:
        return simulation.zero_means_nothing
    return simulation.unit in TEMPERATURES or _shown_by_readings(simulation, measured)


def note_on_zero(simulation: Predictor, measured: Array) -> tuple[str, ...]:
    """Return a note where the readings, and no statement or temperature, made the zero arbitrary."""
    if not _shown_by_readings(simulation, measured):
        return ()
    measured_against = "effects are measured against how far it moves from its mean"
    otherwise = "Where its zero does mean something, state `zero_means_nothing = False`"
    return (f"{simulation.channel} is far from 0 throughout: {measured_against}. {otherwise}.",)


def _shown_by_readings(simulation: Predictor, measured: Array) -> bool:
    """Return whether the readings, and no statement, say that the zero is arbitrary."""
    return simulation.zero_means_nothing is None and simulation.unit in POTENTIALS and is_far_from_zero(measured)


def is_far_from_zero(measured: Array) -> bool:
    """Return whether the readings (time, wheel) of every axis that has any are far from zero."""
    read = measured[:, np.isfinite(measured).any(axis=0)]
    if not read.size:
        return False
    low, high = np.nanquantile(read, WITHIN, axis=0)
    nearest = np.where(low * high > 0, np.minimum(np.abs(low), np.abs(high)), 0.0)
    return bool((nearest > FAR_FROM_ZERO * (high - low)).all())
