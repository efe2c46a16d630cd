"""Courses of noise of many kinds, and of drag in spells, for tests of what comes and goes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.signal.noise_models.local_size import of_usual_noise

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.random import Generator
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

READINGS, RECORDINGS = 4000, 40


def with_memory(random: Generator, readings: float) -> Array:
    """Return noise of size 1 whose autocorrelation falls to 1/e in so many readings."""
    decay = np.exp(-np.arange(int(6 * readings)) / readings)
    long = np.convolve(random.normal(size=READINGS + len(decay) - 1), decay, "valid")
    return np.asarray(long / np.sqrt(np.sum(decay**2)))


def partly(random: Generator, readings: float, slow: float = 0.25) -> Array:
    """Return noise of size 1 with this share of its variance in a memory, the rest in single readings."""
    return np.asarray(np.sqrt(1 - slow) * random.normal(size=READINGS) + np.sqrt(slow) * with_memory(random, readings))


def of_load(random: Generator, readings: int) -> Array:
    """Return noise that grows with a load, which stays for so many readings."""
    load = random.choice([0.3, 0.5, 1.0, 2.0], READINGS // readings)
    return np.asarray(np.repeat(load, readings) * partly(random, 9))


NOISE: dict[str, Callable[[Generator], Array]] = {
    "white": lambda random: random.normal(size=READINGS),
    "memory of 1 s at 5 Hz": lambda random: with_memory(random, 5),
    "memory of 15 s at 5 Hz": lambda random: with_memory(random, 75),
    "partly with a memory of 15 s": lambda random: partly(random, 75, 0.5),
    "quantised": lambda random: np.round(partly(random, 9) / 0.5) * 0.5,
    "heavy tails": lambda random: random.standard_t(3, READINGS),
    "skewed single readings": lambda random: random.exponential(size=READINGS) - 1,
    "grows with load": lambda random: of_load(random, 100),
    "grows with load for long": lambda random: of_load(random, 400),
    "of slowly changing size": lambda random: np.exp(0.5 * with_memory(random, 100)) * random.normal(size=READINGS),
}


def in_spells(random: Generator, rms: float) -> tuple[Array, Array]:
    """Return a drag of 40 to 125 readings with this rms now and then, and whether it acts."""
    acting, at = np.zeros(READINGS, bool), int(random.uniform(50, 250))
    drag = np.zeros(READINGS)
    while at < READINGS:
        length = int(random.uniform(40, 125))
        part = slice(at, min(at + length, READINGS))
        drag[part], acting[part] = random.uniform(0.5, 1.5), True
        at += length + int(random.uniform(125, 450))
    return drag * rms / np.sqrt(np.mean(drag**2)), acting


def over_its_noise(left: Array) -> tuple[Array, Array]:
    """Return the sum of axes (time, axis), or one course (time,), over the size of the noise; nothing is explained."""
    courses = left.reshape(len(left), -1)
    one = np.ones(courses.shape)
    return of_usual_noise(courses - courses.mean(axis=0), 0 * one, one > 0, one)
