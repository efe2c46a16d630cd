"""Effects that the list of names does not have: a solver must find them, measure them, and give them no name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.validation.blind_trials.drive import LEFT
from regolithd.calibration.validation.blind_trials.scene import EVERY_WHEEL, Concealed, Scene, on_wheels

if TYPE_CHECKING:
    from numpy.random import Generator

    from regolithd.calibration.validation.blind_trials.concealed import Maker

Array = NDArray[np.float64]


def _unknown(kind: str, covariate: str, shape: Array, wheels: tuple[int, ...] = EVERY_WHEEL) -> Concealed:
    """Return an effect with no name whose current [A] is proportional to its size."""
    return Concealed(None, kind, covariate, lambda size: size * shape * on_wheels(wheels), wheels)


def voltage(rng: Generator, scene: Scene) -> Concealed:
    """Let the converter's loss follow the bus voltage."""
    volts = scene.drive.voltage_V - np.mean(scene.drive.voltage_V)
    shape = rng.choice([-1.0, 1.0]) * np.tanh(volts / rng.uniform(0.8, 3)) * np.ones((6, 1))
    return _unknown("voltage", "voltage", scene.drive.rotation * shape.T)


def side_hill(rng: Generator, scene: Scene) -> Concealed:
    """Crabbing on a side slope: the lower wheels are dragged, the upper ones relieved."""
    lower = -np.sin(scene.drive.roll_rad)[:, None] * LEFT
    return _unknown("side-hill", "roll", scene.drive.rotation * lower * rng.choice([-1.0, 1.0]))


def pulse(rng: Generator, scene: Scene) -> Concealed:
    """Something on board that switches periodically, whatever the wheels do."""
    beat = np.sin(2 * np.pi * (scene.drive.t_s / rng.uniform(70, 180) + rng.uniform()))
    return _unknown("periodic-in-time", "time", scene.drive.rotation * np.tanh(2 * beat)[:, None])


def rubbing(rng: Generator, scene: Scene) -> Concealed:
    """One wheel's cable rubs in a few spells and is free between them."""
    wheel = int(rng.integers(1, 7))
    part = scene.drive.t_s / scene.drive.t_s[-1]
    on = np.zeros_like(part)
    for spell in range(3):
        start = (spell + rng.uniform(0.1, 0.5)) / 3
        on[(part > start) & (part < start + rng.uniform(0.08, 0.15))] = 1
    return _unknown("rubbing-cable", "time", scene.drive.rotation * on[:, None], (wheel,))


def resonance(rng: Generator, scene: Scene) -> Concealed:
    """Shake the drive at one speed, where it then costs current."""
    off = (np.abs(scene.drive.wheel_speed_rad_s) - rng.uniform(0.2, 0.32)) / rng.uniform(0.03, 0.05)
    return _unknown("resonance", "wheel_speed", scene.drive.rotation * np.exp(-(off**2) / 2))


def grease_peak(rng: Generator, scene: Scene) -> Concealed:
    """Stiffen the grease in one band of temperature and nowhere else."""
    celsius = scene.drive.temperature_degC
    off = (celsius - np.quantile(celsius, rng.uniform(0.35, 0.65))) / rng.uniform(2.5, 4)
    return _unknown("grease-peak", "temperature", scene.drive.rotation * np.exp(-(off**2) / 2))


def slope_drag(rng: Generator, scene: Scene) -> Concealed:
    """Drag on slopes of either sign, as if something touched the ground fore and aft."""
    steep = np.abs(scene.drive.pitch_rad) / 0.1
    return _unknown("slope-drag", "pitch", scene.drive.rotation * (steep ** rng.uniform(1.5, 2.5))[:, None])


OUTSIDE: dict[str, Maker] = {
    "voltage": voltage,
    "side-hill": side_hill,
    "periodic-in-time": pulse,
    "rubbing-cable": rubbing,
    "resonance": resonance,
    "grease-peak": grease_peak,
    "slope-drag": slope_drag,
}
"""How each effect that has no name is made."""
