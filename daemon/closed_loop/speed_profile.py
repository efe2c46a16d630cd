"""Wheel speed over time for both drives, drawn from a seed.

The first drive excites the drivetrain: both directions, many speeds, stops. The second only goes forward, so that it
crosses all soils.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SPEEDS_RAD_S = (0.10, 0.45)
LEG_S = (20.0, 50.0)
RAMP_S = 2.0
STOP, REVERSE = 0.08, 0.4
"""Probability that a leg is a stop, and that it reverses the direction."""


@dataclass(frozen=True, slots=True, eq=False)
class SpeedProfile:
    """Wheel speed [rad/s] at each instant [s]; both of shape (instants,)."""

    time_s: Array
    wheel_speed_rad_s: Array


def shuttle(seed: int, duration_s: float, rate_Hz: float) -> SpeedProfile:
    """Return a profile with speed steps, reversals and stops; duration in s, rate of the instants in Hz."""
    return _legs(np.random.default_rng([seed, 1]), duration_s, rate_Hz, STOP, REVERSE)


def traverse(seed: int, duration_s: float, rate_Hz: float) -> SpeedProfile:
    """Return a forward profile with speed steps; duration in s, rate of the instants in Hz."""
    return _legs(np.random.default_rng([seed, 2]), duration_s, rate_Hz, 0.0, 0.0)


def _legs(random: np.random.Generator, duration_s: float, rate_Hz: float, stop: float, reverse: float) -> SpeedProfile:
    times, speeds, at, direction = [0.0], [0.0], 0.0, 1.0
    while at < duration_s:
        lasts = random.uniform(*LEG_S)
        direction = -direction if random.random() < reverse else direction
        speed = 0.0 if random.random() < stop else direction * random.uniform(*SPEEDS_RAD_S)
        times += [at + RAMP_S, at + lasts]
        speeds += [speed, speed]
        at += lasts
    time_s = np.arange(round(duration_s * rate_Hz), dtype=np.float64) / rate_Hz
    return SpeedProfile(time_s, np.interp(time_s, times, speeds))
