"""Motions, slow paths and noise from a seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.random import Generator

Array = NDArray[np.float64]
Range = tuple[float, float]


def moves(
    rng: Generator, t_s: Array, level: Callable[[Generator], float], rise_s: Range, hold_s: Range
) -> tuple[Array, Array, Array]:
    """Return a path between random levels by minimum-jerk moves, with its first and second derivative in time."""
    path, rate, acceleration = np.zeros((3, len(t_s)))
    start, at = 0.0, level(rng)
    while start <= t_s[-1]:
        to, rise, hold = level(rng), rng.uniform(*rise_s), rng.uniform(*hold_s)
        rows = (t_s >= start) & (t_s < start + rise + hold)
        s = np.clip((t_s[rows] - start) / rise, 0, 1)
        path[rows] = at + (to - at) * s**3 * (10 - 15 * s + 6 * s**2)
        rate[rows] = (to - at) / rise * 30 * s**2 * (1 - s) ** 2
        acceleration[rows] = (to - at) / rise**2 * 60 * s * (1 - s) * (1 - 2 * s)
        start, at = start + rise + hold, to
    return path, rate, acceleration


def stairs(rng: Generator, t_s: Array, level: Callable[[Generator], float], hold_s: Range) -> Array:
    """Return a path that jumps from one random level to the next."""
    path, start = np.zeros(len(t_s)), float(t_s[0])
    while start <= t_s[-1]:
        hold = rng.uniform(*hold_s)
        path[(t_s >= start) & (t_s < start + hold)] = level(rng)
        start += hold
    return path


def wander(rng: Generator, t_s: Array, time_constant_s: float) -> Array:
    """Return a smooth random path of unit standard deviation and mean zero: white noise, low-passed twice."""
    phi = float(np.exp(-(t_s[1] - t_s[0]) / time_constant_s))
    lead = min(len(t_s), int(8 * time_constant_s / (t_s[1] - t_s[0])))
    path = lfilter([1], [1, -phi], lfilter([1], [1, -phi], rng.standard_normal(len(t_s) + lead)))[lead:]
    return (path - path.mean()) / path.std()


def between(rng: Generator, t_s: Array, low: float, high: float, swings: float = 6.0) -> Array:
    """Return a smooth path that fills the range from low to high, some `swings` times up and down."""
    path = wander(rng, t_s, (t_s[-1] - t_s[0]) / swings / 4)
    return low + (high - low) * (path - path.min()) / np.ptp(path)


def correlated_noise(rng: Generator, rows: int, axes: int, phi: float, white: float) -> Array:
    """Return noise of unit variance: first-order autoregressive, and a share `white` of its variance without memory."""
    innovations = rng.standard_normal((rows, axes)) * np.sqrt(1 - phi**2)
    innovations[0] /= np.sqrt(1 - phi**2)
    slow = lfilter([1], [1, -phi], innovations, axis=0)
    return np.sqrt(1 - white) * slow + np.sqrt(white) * rng.standard_normal((rows, axes))
