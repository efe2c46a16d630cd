"""Effects that are not in the solver's library: it must detect and locate them, and give them no name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.validation.blind_trials.recordings.concealed_effect import (
    EVERY_WHEEL,
    ConcealedEffect,
    TrueModel,
    on_wheels,
)
from regolithd.calibration.validation.blind_trials.recordings.traverse import LEFT

if TYPE_CHECKING:
    from numpy.random import Generator

    from regolithd.calibration.validation.blind_trials.recordings.library_effects import Maker

Array = NDArray[np.float64]


def _unknown(kind: str, covariate: str, shape: Array, wheels: tuple[int, ...] = EVERY_WHEEL) -> ConcealedEffect:
    """Return an effect without a name whose current [A] is proportional to its size."""
    return ConcealedEffect(None, kind, covariate, lambda size: size * shape * on_wheels(wheels), wheels)


def voltage(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Model a loss of the converter that depends on the bus voltage."""
    volts = model.traverse.voltage_V - np.mean(model.traverse.voltage_V)
    shape = rng.choice([-1.0, 1.0]) * np.tanh(volts / rng.uniform(0.8, 3)) * np.ones((6, 1))
    return _unknown("voltage", "voltage", model.traverse.rotation * shape.T)


def side_hill(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Side slope: additional drag at the lower wheels, less at the upper ones."""
    lower = -np.sin(model.traverse.roll_rad)[:, None] * LEFT
    return _unknown("side-hill", "roll", model.traverse.rotation * lower * rng.choice([-1.0, 1.0]))


def periodic(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Periodic disturbance: a square-like wave in time, independent of the motion."""
    beat = np.sin(2 * np.pi * (model.traverse.t_s / rng.uniform(70, 180) + rng.uniform()))
    return _unknown("periodic-in-time", "time", model.traverse.rotation * np.tanh(2 * beat)[:, None])


def rubbing(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Rubbing cable: drag at one wheel in three intervals of time."""
    wheel = int(rng.integers(1, 7))
    part = model.traverse.t_s / model.traverse.t_s[-1]
    on = np.zeros_like(part)
    for spell in range(3):
        start = (spell + rng.uniform(0.1, 0.5)) / 3
        on[(part > start) & (part < start + rng.uniform(0.08, 0.15))] = 1
    return _unknown("rubbing-cable", "time", model.traverse.rotation * on[:, None], (wheel,))


def resonance(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Resonance: additional current in a band of speed."""
    off = (np.abs(model.traverse.wheel_speed_rad_s) - rng.uniform(0.2, 0.32)) / rng.uniform(0.03, 0.05)
    return _unknown("resonance", "wheel_speed", model.traverse.rotation * np.exp(-(off**2) / 2))


def grease_peak(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Grease peak: additional drag in a band of temperature."""
    celsius = model.traverse.temperature_degC
    off = (celsius - np.quantile(celsius, rng.uniform(0.35, 0.65))) / rng.uniform(2.5, 4)
    return _unknown("grease-peak", "temperature", model.traverse.rotation * np.exp(-(off**2) / 2))


def slope_drag(rng: Generator, model: TrueModel) -> ConcealedEffect:
    """Slope drag: drag that depends on the magnitude of the pitch."""
    steep = np.abs(model.traverse.pitch_rad) / 0.1
    return _unknown("slope-drag", "pitch", model.traverse.rotation * (steep ** rng.uniform(1.5, 2.5))[:, None])


OUT_OF_LIBRARY: dict[str, Maker] = {
    "voltage": voltage,
    "side-hill": side_hill,
    "periodic-in-time": periodic,
    "rubbing-cable": rubbing,
    "resonance": resonance,
    "grease-peak": grease_peak,
    "slope-drag": slope_drag,
}
"""The effects by kind."""
