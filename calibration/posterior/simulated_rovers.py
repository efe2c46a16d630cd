"""Simulated rovers with measurements at six wheels: the data that the posterior is trained and evaluated with.

Soils are drawn from the prior of `terrain.soils`, loads follow from mass and slope (`wheel_loads`), contact angle and
torque from load, slip and soil (`wheel_soil`); then errors of drivetrain and sensors are added. Slip is drawn at
random, not solved from a balance of forces: at the slip of 0.025 that the paper measured, a smooth wheel pulls less
than its own resistance on each of the four soils, so the balance on level ground would need grousers, which the model
does not have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import Drivetrain, Rover, Wheel
from regolithd.calibration.posterior.window import (
    INTERVAL_S,
    UNCERTAINTY_HIGH,
    UNCERTAINTY_LOW,
    CalibrationUncertainty,
    REFERENCE_TORQUE_Nm,
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

DEFAULT_SHARE = 1 / 3
"""Share of the drawn rovers that have the default `window.CalibrationUncertainty`."""

WRONG_NOISE_SHARE = 0.35
"""Share of the rovers whose stated noise is that of another rover."""

LOW_NOISE_SHARE = 0.06
"""Share of the rovers with almost no noise."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasurementNoise:
    """Noise of the measurements of N rovers, from sensors and ground; each of shape (N, 1) or (N, 6).

    Attributes
    ----------
    current, load
        Total relative standard deviation [1].
    drop_rate
        Share of the instants with a momentary drop of current [1]; its variance is part of `current`.
    correlation_time_s
        Correlation time of the other noise of the current [s].
    """

    current: Array
    load: Array
    drop_rate: Array
    correlation_time_s: Array


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRovers:
    """N rovers: true values, and the uncertainty of their calibration.

    Attributes
    ----------
    soils, nearest_class
        Soils, and the index in `SOILS` of the nearest class, shape (N,).
    load_N, slip, no_load_A
        True mean load, slip and no-load current, shape (N, 6).
    gain_error, no_load_error_A
        Error of the calibration: relative of the gain, absolute of the no-load current, shape (N, 6).
    slip_error
        Systematic error of the slip, shape (N, 1).
    uncertainty
        The numbers of `window.CalibrationUncertainty`, shape (N, 5).
    """

    soils: Soils
    nearest_class: NDArray[np.intp]
    load_N: Array
    slip: Array
    no_load_A: Array
    gain_error: Array
    no_load_error_A: Array
    slip_error: Array
    uncertainty: Array


@dataclass(frozen=True, slots=True, eq=False)
class Measurements:
    """Measurements, each of shape (N, instants, 6); `torque_Nm` follows from `current_A` by Eq. 11."""

    load_N: Array
    slip: Array
    torque_Nm: Array
    current_A: Array


def draw_noise(count: int, rng: np.random.Generator) -> MeasurementNoise:
    """Draw noise of 5–45 % of the current, similar at all wheels of a rover.

    A share of `LOW_NOISE_SHARE` has almost none and no drops, so that the training covers even ground.
    """
    low_noise = rng.random((count, 1)) < LOW_NOISE_SHARE
    level = np.where(low_noise, rng.uniform(0.0, 0.05, (count, 1)), rng.uniform(0.05, 0.45, (count, 1)))
    return MeasurementNoise(
        current=np.clip(level * np.exp(0.12 * rng.standard_normal((count, WHEELS))), 0.0, 0.5),
        load=np.where(low_noise, 0.1, 1.0) * rng.uniform(0.01, 0.16, (count, WHEELS)),
        drop_rate=np.where(low_noise, 0.0, rng.uniform(0.0, 0.08, (count, 1))),
        correlation_time_s=rng.uniform(0.05, 1.5, (count, 1)),
    )


def table_4_noise(count: int) -> MeasurementNoise:
    """Return the noise of the paper's Table 4 (prepared ground), wheel by wheel; one instant in twenty has a drop."""
    return MeasurementNoise(
        np.tile(TABLE_4_CURRENT, (count, 1)),
        np.tile(TABLE_4_LOAD, (count, 1)),
        np.full((count, 1), 0.05),
        np.full((count, 1), 0.5),
    )


def no_noise(count: int) -> MeasurementNoise:
    """Return zero noise of current and load."""
    none = np.zeros((count, 1))
    return MeasurementNoise(np.zeros((count, WHEELS)), np.zeros((count, WHEELS)), none, none + 0.5)


def draw_rovers(
    count: int, rng: np.random.Generator, uncertainty: Array | None = None, no_load_A: float | None = None
) -> SimulatedRovers:
    """Draw rovers on soils of the prior; uncertainty, shape (N, 5), and no-load current [A] are drawn where None."""
    soils, nearest = draw_soils(count, rng)
    uncertainty = _draw_uncertainty(count, rng) if uncertainty is None else uncertainty
    slope = np.radians(5) * rng.standard_normal((count, 2))
    load = wheel_loads(slope[:, 0], slope[:, 1], Rover()) * np.exp(0.05 * rng.standard_normal((count, 1)))
    load *= np.exp(0.2 * rng.standard_normal((count, WHEELS)))
    slip = np.exp(rng.uniform(np.log(0.005), np.log(0.2), (count, 1)) + 0.15 * rng.standard_normal((count, WHEELS)))
    gain_std, no_load_std, slip_std = uncertainty.T[:3, :, None]
    return SimulatedRovers(
        soils=soils,
        nearest_class=nearest,
        load_N=np.clip(load, 8, 120),
        slip=slip,
        no_load_A=np.ones((count, WHEELS)) * (uncertainty[:, 4:5] if no_load_A is None else no_load_A),
        gain_error=gain_std * (rng.standard_normal((count, 1)) + 0.5 * rng.standard_normal((count, WHEELS))),
        no_load_error_A=no_load_std * (rng.standard_normal((count, 1)) + 0.5 * rng.standard_normal((count, WHEELS))),
        slip_error=slip_std * rng.standard_normal((count, 1)),
        uncertainty=uncertainty,
    )


def _draw_uncertainty(count: int, rng: np.random.Generator) -> Array:
    """Draw calibration uncertainties, shape (N, 5): log-uniform in their range, or the default for one rover in three.

    They are inputs of the network: their distribution determines where it is trained most, and is no prior of the soil.
    """
    uncertainty = np.exp(rng.uniform(np.log(UNCERTAINTY_LOW), np.log(UNCERTAINTY_HIGH), (count, len(UNCERTAINTY_LOW))))
    uncertainty[:, 4] = rng.uniform(UNCERTAINTY_LOW[4], UNCERTAINTY_HIGH[4], count)
    return np.where(rng.random((count, 1)) < DEFAULT_SHARE, CalibrationUncertainty().deviations(), uncertainty)


def stated_noise(
    rovers: SimulatedRovers, noise: MeasurementNoise, gain_Nm_per_A: float, rng: np.random.Generator
) -> Array:
    """Return `torque_noise_Nm` as a rover's configuration states it [N·m], shape (N,).

    It is the noise at `REFERENCE_TORQUE_Nm`, since the noise at the actual torque would reveal the soil. It has an
    error of 15 %, and for `WRONG_NOISE_SHARE` of them it is another's, so that the network does not rely on it.
    """
    usual = REFERENCE_TORQUE_Nm + gain_Nm_per_A * rovers.no_load_A.mean(axis=1)
    level = noise.current.mean(axis=1)
    stated = np.where(rng.random(len(level)) < WRONG_NOISE_SHARE, rng.permutation(level), level)
    return np.clip(
        stated * usual * np.exp(0.15 * rng.standard_normal(len(usual))), UNCERTAINTY_LOW[3], UNCERTAINTY_HIGH[3]
    )


def drawbar_margins(rovers: SimulatedRovers, wheel: Wheel) -> Array:
    """Return the drawbar margin of each rover [1], shape (N,): of its six wheels together, over their load."""
    soils = rovers.soils.per_wheel()
    angle = contact_angle(rovers.load_N, rovers.slip, wheel, soils)
    margin = drawbar_margin(angle, rovers.slip, wheel, soils)
    return np.sum(margin * rovers.load_N, axis=1) / np.sum(rovers.load_N, axis=1)


def simulate_measurements(
    rovers: SimulatedRovers,
    noise: MeasurementNoise,
    instants: int,
    rng: np.random.Generator,
    drivetrain: Drivetrain,
    wheel: Wheel,
) -> Measurements:
    """Return the measurements of each rover over `instants` half seconds, with noise and calibration errors."""
    shape = (len(rovers.uncertainty), instants, WHEELS)
    half = noise.load[:, None] / np.sqrt(2)
    true_load = rovers.load_N[:, None] * np.clip(1 + half * _correlated(shape, 1.0, rng), 0.2, None)
    soils = rovers.soils.per_wheel().per_wheel()
    slip = np.broadcast_to(rovers.slip[:, None], shape)
    angle = contact_angle(true_load, slip, wheel, soils)
    torque = wheel_torque(angle, slip, wheel, soils)
    gain = drivetrain.gain_Nm_per_A
    true_gain = gain * (1 + rovers.gain_error[:, None])
    current = rovers.no_load_A[:, None] + torque / true_gain + rovers.no_load_error_A[:, None]
    current = current * current_noise_factor(noise, shape, rng)
    return Measurements(
        load_N=true_load * (1 + half * rng.standard_normal(shape)),
        slip=slip + rovers.slip_error[:, None] + 0.01 * rng.standard_normal(shape),
        torque_Nm=gain * (current - rovers.no_load_A[:, None]),
        current_A=current,
    )


def current_noise_factor(noise: MeasurementNoise, shape: tuple[int, int, int], rng: np.random.Generator) -> Array:
    """Return the factor on the current: correlated noise and drops to 20–70 %, with a total std of `noise.current`."""
    rate = noise.drop_rate[:, None]
    # A drop leaves the fraction f, uniform in [0.2, 0.7]: E f = 0.45, E f² = 0.223.
    kept, squared = 1 - rate * 0.55, 1 - rate * (1 - 0.22333)
    drops_variance = squared - kept**2
    own = np.sqrt(np.clip((noise.current[:, None] ** 2 - drops_variance) / squared, 0, None))
    dropped = np.where(rng.random(shape) < rate, rng.uniform(0.2, 0.7, shape), 1.0)
    return dropped * (1 + own * _correlated(shape, noise.correlation_time_s[:, None], rng))


def _correlated(shape: tuple[int, int, int], correlation_time_s: Array | float, rng: np.random.Generator) -> Array:
    """Return unit-variance noise of first order along the second axis."""
    keep = np.broadcast_to(np.exp(-INTERVAL_S / np.asarray(correlation_time_s)), (shape[0], 1, 1))[:, 0]
    values = rng.standard_normal(shape)
    for k in range(1, shape[1]):
        values[:, k] = keep * values[:, k - 1] + np.sqrt(1 - keep**2) * values[:, k]
    return values
