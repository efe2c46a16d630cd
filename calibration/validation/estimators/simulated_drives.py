"""Long simulated drives over one soil, or from one soil to another: measurements that the alarm is evaluated with.

For speed the torque is a polynomial in ln load and slip, fitted once to the wheel–soil model of each soil (relative
error about 0.001). Pitch and roll are sinusoids of ±5° with periods of about two minutes; they change the loads of the
wheels, and the slip, which is 0.025 + 0.5 sin(pitch), at least 0.01.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import SOILS, Drivetrain, Rover, Soil, Wheel
from regolithd.calibration.posterior.simulated_rovers import TABLE_4_LOAD
from regolithd.calibration.posterior.window import INTERVAL_S
from regolithd.calibration.terrain.wheel_loads import wheel_loads
from regolithd.calibration.terrain.wheel_soil import contact_angle, wheel_torque

if TYPE_CHECKING:
    from collections.abc import Iterator

Array = NDArray[np.float64]

SPEED_M_S = 0.022
NO_LOAD_A = 0.037
_DEGREE = 5


@dataclass(frozen=True, slots=True, eq=False)
class TorqueCurve:
    """Torque on one soil: ln T as a polynomial of ln load and slip."""

    coefficients: Array

    def __call__(self, load_N: Array, slip: Array) -> Array:
        """Return the torque [N·m]; loads are clipped to 5–150 N, slips to −0.02–0.25."""
        return np.exp(np.polynomial.polynomial.polyval2d(_x(load_N), _y(slip), self.coefficients))


def _x(load_N: Array) -> Array:
    return np.log(np.clip(load_N, 5, 150) / 27) / 1.7


def _y(slip: Array) -> Array:
    return (np.clip(slip, -0.02, 0.25) - 0.115) / 0.135


def torque_curve(soil: Soil, wheel: Wheel) -> TorqueCurve:
    """Return the curve that is fitted to the wheel–soil model of a soil."""
    load, slip = np.meshgrid(np.geomspace(5, 150, 40), np.linspace(-0.02, 0.25, 30))
    torque = wheel_torque(contact_angle(load, slip, wheel, soil), slip, wheel, soil)
    basis = np.polynomial.polynomial.polyvander2d(_x(load).ravel(), _y(slip).ravel(), [_DEGREE, _DEGREE])
    solution, *_ = np.linalg.lstsq(basis, np.log(torque).ravel(), rcond=None)
    return TorqueCurve(np.asarray(solution, np.float64).reshape(_DEGREE + 1, _DEGREE + 1))


@dataclass(frozen=True, slots=True)
class SimulatedDrive:
    """Settings of simultaneous drives of several rovers.

    Attributes
    ----------
    rovers
        Number of rovers.
    change_at
        Half second at which the front axle meets the second soil; None for a drive over the first soil only.
    at_once
        Whether all axles meet the second soil at once, instead of half a wheelbase after each other.
    first, second
        Soils, keys of `SOILS`.
    noise
        Relative standard deviation of the recorded current [1].
    correlation_time_s
        Correlation time of that noise [s]; 0 is white noise.
    drop_rate
        Share of the half seconds with a momentary drop of current [1].
    no_load_A
        No-load current [A].
    slope_deg
        Amplitude of pitch and roll [°].
    """

    rovers: int
    change_at: int | None = None
    at_once: bool = False
    first: str = "sandy-loam"
    second: str = "lete-sand"
    noise: float = 0.35
    correlation_time_s: float = 0.0
    drop_rate: float = 0.03
    no_load_A: float = NO_LOAD_A
    slope_deg: float = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Instant:
    """Measurements of one half second of all drives, shape (rovers, 6)."""

    load_N: Array
    slip: Array
    current_A: Array
    torque_Nm: Array


def instants(drive: SimulatedDrive, length: int, rng: np.random.Generator) -> Iterator[Instant]:
    """Yield the measurements of `length` half seconds."""
    wheel, gain = Wheel(), Drivetrain().gain_Nm_per_A
    first, second = (torque_curve(SOILS[name], wheel) for name in (drive.first, drive.second))
    shape = (drive.rovers, 6)
    period = rng.uniform(160, 320, (2, drive.rovers))
    phase = rng.uniform(0, 2 * np.pi, (2, drive.rovers))
    keep = np.exp(-INTERVAL_S / drive.correlation_time_s) if drive.correlation_time_s > 0 else 0.0
    rest, ground = rng.standard_normal(shape), rng.standard_normal(shape)
    between = 0 if drive.at_once else Rover().wheelbase_m / 2 / SPEED_M_S / INTERVAL_S
    meets = np.repeat([0, between, 2 * between], 2) + (length if drive.change_at is None else drive.change_at)
    for k in range(length):
        pitch, roll = np.radians(drive.slope_deg) * np.sin(2 * np.pi * k / period + phase)
        ground = 0.6 * ground + 0.8 * rng.standard_normal(shape)
        load = wheel_loads(pitch, roll, Rover()) * np.clip(1 + TABLE_4_LOAD / np.sqrt(2) * ground, 0.3, None)
        slip = np.broadcast_to((0.025 + 0.5 * np.clip(np.sin(pitch), -0.03, None))[:, None], shape)
        torque = np.where(k >= meets, second(load, slip), first(load, slip))
        rest = keep * rest + np.sqrt(1 - keep**2) * rng.standard_normal(shape)
        dropped = np.where(rng.random(shape) < drive.drop_rate, rng.uniform(0.2, 0.7, shape), 1.0)
        current = (drive.no_load_A + torque / gain) * dropped * (1 + drive.noise * rest)
        yield Instant(
            load_N=load * (1 + TABLE_4_LOAD / np.sqrt(2) * rng.standard_normal(shape)),
            slip=slip + 0.01 * rng.standard_normal(shape),
            current_A=current,
            torque_Nm=gain * (current - drive.no_load_A),
        )
