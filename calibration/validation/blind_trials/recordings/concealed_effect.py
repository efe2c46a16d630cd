"""A concealed effect, and the true model of the recording that it is added to."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.random import Generator

    from regolithd.calibration.validation.blind_trials.recordings.ground import Ground, TorqueTable
    from regolithd.calibration.validation.blind_trials.recordings.traverse import Traverse

Array = NDArray[np.float64]

EVERY_WHEEL = (1, 2, 3, 4, 5, 6)


@dataclass(frozen=True)
class TrueModel:
    """The true base model on a traverse: motor currents before any effect is added."""

    traverse: Traverse
    ground: Ground
    torque: TorqueTable
    gain_Nm_per_A: float

    @property
    def current_A(self) -> Array:
        """Motor current of the base model [A], signed by the direction of rotation, (n, 6)."""
        return self.traverse.rotation * self.torque(self.traverse.load_N, self.traverse.slip) / self.gain_Nm_per_A

    @property
    def mean_current_A(self) -> float:
        """Mean absolute current of the turning wheels [A]; strengths are relative to it."""
        return float(np.mean(np.abs(self.current_A[self.traverse.moving])))


@dataclass(frozen=True)
class ConcealedEffect:
    """One effect, and its true values.

    Attributes
    ----------
    name
        Name in the library of candidates; None for an effect out of the library.
    kind, covariate
        Kind of the effect, and the quantity that it depends on.
    added_current_A
        Current that the effect adds at a size [A], (n, 6).
    wheels, onset_s
        Wheels that it acts on, and the time from which it acts [s].
    largest
        Largest size that is physically possible.
    added_load_N
        Error of the load cells at a size [N], (n, 6), for effects on a load cell.
    parameters
        True values of the parameters of the library's form, where it has the same parameter.
    size, strength
        Size, and the rms over the mean current that it amounts to.
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


def relative_strength(model: TrueModel, effect: ConcealedEffect, size: float) -> float:
    """Return the effect's rms, over the rows where it acts and as if spread over six wheels, over the mean current."""
    acting = model.traverse.moving.copy()
    acting[:, [wheel - 1 for wheel in EVERY_WHEEL if wheel not in effect.wheels]] = False
    if effect.onset_s is not None:
        acting[model.traverse.t_s < effect.onset_s] = False
    power = float(np.mean(effect.added_current_A(size)[acting] ** 2)) * len(effect.wheels) / 6
    return float(np.sqrt(power)) / model.mean_current_A


def of_strength(model: TrueModel, effect: ConcealedEffect, strength: float) -> ConcealedEffect:
    """Return the effect with the size that has this relative strength, or with its largest size."""

    def missing(size: float) -> float:
        return relative_strength(model, effect, size) - strength

    most = effect.largest
    size = float(brentq(missing, 0, most, xtol=1e-6 * most)) if missing(most) > 0 else most
    return replace(effect, size=size, strength=relative_strength(model, effect, size))


def some_wheels(rng: Generator) -> tuple[int, ...]:
    """Return all wheels or, with a probability of 0.1, one axle or one side."""
    groups = ((1, 2), (3, 4), (5, 6), (1, 3, 5), (2, 4, 6))
    return EVERY_WHEEL if rng.uniform() < 0.9 else groups[rng.integers(len(groups))]


def on_wheels(wheels: tuple[int, ...]) -> Array:
    """Return 1 for these wheels and 0 for the others, (6,)."""
    return np.array([float(wheel in wheels) for wheel in EVERY_WHEEL])
