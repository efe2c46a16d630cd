"""What a concealed effect is, and the scene that it is put into."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.random import Generator

    from regolithd.calibration.validation.blind_trials.drive import Drive
    from regolithd.calibration.validation.blind_trials.ground import Ground, TorqueTable

Array = NDArray[np.float64]

EVERY_WHEEL = (1, 2, 3, 4, 5, 6)


@dataclass(frozen=True)
class Scene:
    """A drive on one ground: what the true motors draw [A] before anything is concealed, (n, 6)."""

    drive: Drive
    ground: Ground
    torque: TorqueTable
    gain_Nm_per_A: float

    @property
    def current_A(self) -> Array:
        """Current of the true base model, signed with the rotation, (n, 6)."""
        return self.drive.rotation * self.torque(self.drive.load_N, self.drive.slip) / self.gain_Nm_per_A

    @property
    def mean_current_A(self) -> float:
        """Mean absolute current over all rows in which a wheel turns: what strengths are relative to."""
        return float(np.mean(np.abs(self.current_A[self.drive.moving])))


@dataclass(frozen=True)
class Concealed:
    """One effect: what it adds to the current [A] at a given size, and what to call it when the envelope opens.

    `name` is None for what the list of names does not have. `added_load_N` is what one load cell reads too much.
    `parameters` are the true values in the units of the contract, where the contract's form has such a value.
    """

    name: str | None
    kind: str
    covariate: str
    added_current_A: Callable[[float], Array]
    wheels: tuple[int, ...] = EVERY_WHEEL
    onset_s: float | None = None
    largest: float = 1.0
    added_load_N: Callable[[float], Array] | None = None
    parameters: Callable[[float], dict[str, float]] = field(default=lambda _: {})
    size: float = 0.0
    strength: float = 0.0


def relative_strength(scene: Scene, effect: Concealed, size: float) -> float:
    """Return the effect's rms over the mean current: over the rows where it acts, as if spread over six wheels."""
    acting = scene.drive.moving.copy()
    acting[:, [wheel - 1 for wheel in EVERY_WHEEL if wheel not in effect.wheels]] = False
    if effect.onset_s is not None:
        acting[scene.drive.t_s < effect.onset_s] = False
    power = float(np.mean(effect.added_current_A(size)[acting] ** 2)) * len(effect.wheels) / 6
    return float(np.sqrt(power)) / scene.mean_current_A


def of_strength(scene: Scene, effect: Concealed, strength: float) -> Concealed:
    """Return the effect sized so that its relative strength is the wanted one, or the most it can physically be."""

    def missing(size: float) -> float:
        return relative_strength(scene, effect, size) - strength

    most = effect.largest
    size = float(brentq(missing, 0, most, xtol=1e-6 * most)) if missing(most) > 0 else most
    return replace(effect, size=size, strength=relative_strength(scene, effect, size))


def some_wheels(rng: Generator) -> tuple[int, ...]:
    """Return every wheel, or now and then one axle or one side."""
    groups = ((1, 2), (3, 4), (5, 6), (1, 3, 5), (2, 4, 6))
    return EVERY_WHEEL if rng.uniform() < 0.9 else groups[rng.integers(len(groups))]


def on_wheels(wheels: tuple[int, ...]) -> Array:
    """Return 1 for the wheels named and 0 for the others, (6,)."""
    return np.array([float(wheel in wheels) for wheel in EVERY_WHEEL])
