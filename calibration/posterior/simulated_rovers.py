"""Rovers as they can be, on soils as they can be: what the posterior is trained on and tested with.

Load follows from mass and slope, sinkage is what carries the load (`wheel_soil`), torque follows, and then drivetrain
and sensors do what they do. Slip is drawn, not solved for: with this model a smooth wheel at the slip of 0.025 that the
paper measured pulls less than its own resistance on each of the four soils, so that the balance of forces on level
ground – which would add an equation – holds for grousers that the model has not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import Drivetrain, Rover, Wheel
from regolithd.calibration.posterior.window import (
    INTERVAL_S,
    KNOWN_HIGH,
    KNOWN_LOW,
    CalibrationUncertainty,
    USUAL_TORQUE_Nm,
)
from regolithd.calibration.terrain.drawbar import drawbar_margin
from regolithd.calibration.terrain.soils import Soils, draw_soils
from regolithd.calibration.terrain.wheel_loads import wheel_loads
from regolithd.calibration.terrain.wheel_soil import contact_angle, wheel_torque

Array = NDArray[np.float64]
WHEELS = 6

TABLE_4_CURRENT = np.array([31.2, 38.8, 31.3, 36.5, 31.2, 35.1]) / 100
"""Relative standard deviation of the recorded currents, prepared ground (the paper's Table 4)."""

TABLE_4_LOAD = np.array([14.2, 11.9, 9.6, 7.0, 6.7, 7.2]) / 100
"""Relative standard deviation of the recorded loads, prepared ground."""

USUALLY = 1 / 3
"""How many of the rovers that are drawn are known as `window.CalibrationUncertainty` says by default."""

TOLD_WRONG = 0.35
"""How many of the rovers are told the scatter of another ground."""

QUIET = 0.06
"""How many of the rovers whose noise is drawn are on ground that makes hardly any."""


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """What sensors and ground do to the measurements; each of shape (N, 1) or (N, 6).

    `current` and `load` are relative standard deviations in all; `drop_rate` is how many instants in one have a
    momentary drop of current, and is part of `current`; `memory_s` is the correlation time of the rest.
    """

    current: Array
    load: Array
    drop_rate: Array
    memory_s: Array


@dataclass(frozen=True, slots=True, eq=False)
class Rovers:
    """Rovers standing ready: truth, and what is known of each.

    Soils have shape (N,), `slip_error` (N, 1), `known` (N, 5) in the order of
    `window.CalibrationUncertainty`, the others (N, 6).
    """

    soils: Soils
    nearest: NDArray[np.intp]
    load_N: Array
    slip: Array
    no_load_A: Array
    gain_error: Array
    no_load_error_A: Array
    slip_error: Array
    known: Array


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """What the daemon would see, each of shape (N, instants, 6); `current_A` is before Eq. 11."""

    load_N: Array
    slip: Array
    torque_Nm: Array
    current_A: Array


def draw_noise(count: int, rng: np.random.Generator) -> Noise:
    """Return noise as uncertain as before one knows the ground: 5–45 % of the current, much alike at all wheels.

    A few are on ground so even that there is hardly any, and no drops: else the posterior would not know it.
    """
    quiet = rng.random((count, 1)) < QUIET
    level = np.where(quiet, rng.uniform(0.0, 0.05, (count, 1)), rng.uniform(0.05, 0.45, (count, 1)))
    return Noise(
        current=np.clip(level * np.exp(0.12 * rng.standard_normal((count, WHEELS))), 0.0, 0.5),
        load=np.where(quiet, 0.1, 1.0) * rng.uniform(0.01, 0.16, (count, WHEELS)),
        drop_rate=np.where(quiet, 0.0, rng.uniform(0.0, 0.08, (count, 1))),
        memory_s=rng.uniform(0.05, 1.5, (count, 1)),
    )


def table_4_noise(count: int) -> Noise:
    """Return the noise of the paper's prepared traverse, wheel by wheel; one instant in twenty has a drop."""
    return Noise(
        np.tile(TABLE_4_CURRENT, (count, 1)),
        np.tile(TABLE_4_LOAD, (count, 1)),
        np.full((count, 1), 0.05),
        np.full((count, 1), 0.5),
    )


def no_noise(count: int) -> Noise:
    """Return no noise on current and load at all."""
    none = np.zeros((count, 1))
    return Noise(np.zeros((count, WHEELS)), np.zeros((count, WHEELS)), none, none + 0.5)


def draw_rovers(
    count: int, rng: np.random.Generator, known: Array | None = None, no_load_A: float | None = None
) -> Rovers:
    """Return rovers on soils that they may meet; `known`, shape (N, 5), as in `Rovers`, or drawn where it is None."""
    soils, nearest = draw_soils(count, rng)
    known = _draw_known(count, rng) if known is None else known
    slope = np.radians(5) * rng.standard_normal((count, 2))
    load = wheel_loads(slope[:, 0], slope[:, 1], Rover()) * np.exp(0.05 * rng.standard_normal((count, 1)))
    load *= np.exp(0.2 * rng.standard_normal((count, WHEELS)))
    slip = np.exp(rng.uniform(np.log(0.005), np.log(0.2), (count, 1)) + 0.15 * rng.standard_normal((count, WHEELS)))
    gain_std, no_load_std, slip_std = known.T[:3, :, None]
    return Rovers(
        soils=soils,
        nearest=nearest,
        load_N=np.clip(load, 8, 120),
        slip=slip,
        no_load_A=np.ones((count, WHEELS)) * (known[:, 4:5] if no_load_A is None else no_load_A),
        gain_error=gain_std * (rng.standard_normal((count, 1)) + 0.5 * rng.standard_normal((count, WHEELS))),
        no_load_error_A=no_load_std * (rng.standard_normal((count, 1)) + 0.5 * rng.standard_normal((count, WHEELS))),
        slip_error=slip_std * rng.standard_normal((count, 1)),
        known=known,
    )


def _draw_known(count: int, rng: np.random.Generator) -> Array:
    """Return how well rovers may be known, shape (N, 5): anything in its range, and in one of three what is usual.

    All of it is told to the posterior, so that these shares say where it learns most, and nothing of the soil.
    """
    known = np.exp(rng.uniform(np.log(KNOWN_LOW), np.log(KNOWN_HIGH), (count, len(KNOWN_LOW))))
    known[:, 4] = rng.uniform(KNOWN_LOW[4], KNOWN_HIGH[4], count)
    return np.where(rng.random((count, 1)) < USUALLY, CalibrationUncertainty().deviations(), known)


def told_scatter(rovers: Rovers, noise: Noise, gain_Nm_per_A: float, rng: np.random.Generator) -> Array:
    """Return the scatter of torque that is told [N·m], shape (N,): known to 15 %, or that of another rover's ground.

    It is that of a wheel at `USUAL_TORQUE_Nm`. The scatter at the torque which the soil asks for would tell the soil.
    A rover that tells what is usual may be on other ground, so that what is told must not be believed too much.
    """
    usual = USUAL_TORQUE_Nm + gain_Nm_per_A * rovers.no_load_A.mean(axis=1)
    level = noise.current.mean(axis=1)
    told = np.where(rng.random(len(level)) < TOLD_WRONG, rng.permutation(level), level)
    return np.clip(told * usual * np.exp(0.15 * rng.standard_normal(len(usual))), KNOWN_LOW[3], KNOWN_HIGH[3])


def margins(rovers: Rovers, wheel: Wheel) -> Array:
    """Return the drawbar margin of each rover [1], shape (N,): of its six wheels together, over its weight."""
    soils = rovers.soils.per_wheel()
    angle = contact_angle(rovers.load_N, rovers.slip, wheel, soils)
    margin = drawbar_margin(angle, rovers.slip, wheel, soils)
    return np.sum(margin * rovers.load_N, axis=1) / np.sum(rovers.load_N, axis=1)


def drive(
    rovers: Rovers, noise: Noise, instants: int, rng: np.random.Generator, drivetrain: Drivetrain, wheel: Wheel
) -> Measured:
    """Drive each rover for `instants` half-seconds and return what its sensors say, drivetrain errors and all."""
    shape = (len(rovers.known), instants, WHEELS)
    half = noise.load[:, None] / np.sqrt(2)
    true_load = rovers.load_N[:, None] * np.clip(1 + half * _correlated(shape, 1.0, rng), 0.2, None)
    soils = rovers.soils.per_wheel().per_wheel()
    slip = np.broadcast_to(rovers.slip[:, None], shape)
    angle = contact_angle(true_load, slip, wheel, soils)
    torque = wheel_torque(angle, slip, wheel, soils)
    gain = drivetrain.gain_Nm_per_A
    true_gain = gain * (1 + rovers.gain_error[:, None])
    current = rovers.no_load_A[:, None] + torque / true_gain + rovers.no_load_error_A[:, None]
    current = current * disturb(noise, shape, rng)
    return Measured(
        load_N=true_load * (1 + half * rng.standard_normal(shape)),
        slip=slip + rovers.slip_error[:, None] + 0.01 * rng.standard_normal(shape),
        torque_Nm=gain * (current - rovers.no_load_A[:, None]),
        current_A=current,
    )


def disturb(noise: Noise, shape: tuple[int, int, int], rng: np.random.Generator) -> Array:
    """Return the factor on the current: correlated noise, and drops to 20–70 %; together `noise.current`."""
    rate = noise.drop_rate[:, None]
    # A drop leaves the fraction f, uniform in [0.2, 0.7]: E f = 0.45, E f² = 0.223.
    kept, squared = 1 - rate * 0.55, 1 - rate * (1 - 0.22333)
    drops_variance = squared - kept**2
    own = np.sqrt(np.clip((noise.current[:, None] ** 2 - drops_variance) / squared, 0, None))
    dropped = np.where(rng.random(shape) < rate, rng.uniform(0.2, 0.7, shape), 1.0)
    return dropped * (1 + own * _correlated(shape, noise.memory_s[:, None], rng))


def _correlated(shape: tuple[int, int, int], memory_s: Array | float, rng: np.random.Generator) -> Array:
    """Return unit-variance noise of first order along the second axis."""
    keep = np.broadcast_to(np.exp(-INTERVAL_S / np.asarray(memory_s)), (shape[0], 1, 1))[:, 0]
    values = rng.standard_normal(shape)
    for k in range(1, shape[1]):
        values[:, k] = keep * values[:, k - 1] + np.sqrt(1 - keep**2) * values[:, k]
    return values
