"""Posterior of cohesion, friction angle and drawbar margin from a window of measurements, on the rover.

NumPy and onnxruntime only. A `Buffer` collects measurements into a window; a `PosteriorEstimator` runs the posterior
network on it. Neither reads a clock: the time comes with the measurements, so that a replay gives the same numbers.

The result is the posterior under the prior of `terrain.soils`. Its intervals widen with less data: one instant of one
wheel adds little to the prior.
"""

from __future__ import annotations

import json
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.models import POSTERIOR_MODEL
from regolithd.calibration.models.onnx_session import ModelError, open_session
from regolithd.calibration.posterior.mixture import TARGETS, Mixture, unpack
from regolithd.calibration.posterior.window import (
    INTERVAL_S,
    KNOWN,
    MAX_INSTANTS,
    CalibrationUncertainty,
    Windows,
    reduce_windows,
)

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Array = NDArray[np.float64]

LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Quantiles that are published: limits of the 90 % and 50 % intervals, and the median."""

WHEELS = 6
_SAMPLES = 4000
_SEED = 20


REMEDY = "Train one (`regolithd train-posterior`), or correct [posterior] model."


class PosteriorModelError(ModelError):
    """A file is not a posterior network with the inputs, targets and metadata that the daemon needs."""


@dataclass(frozen=True, slots=True)
class Interval:
    """Posterior of one quantity: mean, and the quantiles of `LEVELS`; SI units."""

    mean: float
    low_90: float
    low_50: float
    median: float
    high_50: float
    high_90: float


@dataclass(frozen=True, slots=True)
class Posterior:
    """Posterior of the soil under the rover given one window; numbers of wheels and instants with measurements."""

    cohesion_Pa: Interval
    friction_angle_rad: Interval
    drawbar_margin: Interval
    wheels: int
    instants: int


@dataclass(frozen=True, slots=True)
class FallProbability:
    """Probability that each quantity decreased from one window to another [1]; part of an alarm."""

    cohesion: float
    friction_angle: float
    drawbar_margin: float


@dataclass(slots=True)
class Buffer:
    """The last `length_s` seconds of measurements as half-second means; NaN where a wheel has no measurement."""

    length_s: float = 10.0
    _completed: deque[Array] = field(default_factory=deque)
    _current: list[Array] = field(default_factory=list)
    _slot: int | None = None

    def add(self, time_ns: int, load_N: Array, slip: Array, torque_Nm: Array) -> bool:
        """Add one snapshot's load [N], slip [1], torque [N·m], each (6,); return whether a half second is complete."""
        slot = time_ns // int(INTERVAL_S * 1e9)
        completed = self._slot is not None and slot != self._slot
        if completed:
            self._complete()
        if self._slot is not None and not 0 <= slot - self._slot <= self.instants:
            self._completed.clear()  # a gap as long as the window, or time going backwards: start again
        self._slot = slot
        self._current.append(np.array([load_N, slip, torque_Nm], np.float64))
        return completed

    @property
    def instants(self) -> int:
        """Number of half seconds in a full window."""
        return max(1, min(MAX_INSTANTS, round(self.length_s / INTERVAL_S)))

    def window(self) -> Array:
        """Return load, slip and torque of the completed half seconds, shape (3, instants, 6); may be empty."""
        return np.stack(self._completed, axis=1) if self._completed else np.empty((3, 0, WHEELS))

    def _complete(self) -> None:
        values = np.stack(self._current)
        known = np.isfinite(values)
        count = known.sum(axis=0)
        total = np.where(known, values, 0.0).sum(axis=0)
        self._completed.append(np.where(count > 0, total / np.maximum(count, 1), np.nan))
        self._current.clear()
        while len(self._completed) > self.instants:
            self._completed.popleft()


class PosteriorEstimator:
    """A posterior network, loaded from an ONNX file.

    Raises
    ------
    ModelError
        The file is absent or damaged (`open_session`), or not a posterior network (`PosteriorModelError`).
    """

    def __init__(self, path: Path = POSTERIOR_MODEL) -> None:
        self._session = open_session(path, REMEDY)
        if {each.name: each.shape[-1] for each in self._session.get_inputs()}.get("known") != KNOWN:
            raise PosteriorModelError(f"{path}: was trained with other inputs. {REMEDY}")
        try:
            metadata: Mapping[str, str] = self._session.get_modelmeta().custom_metadata_map
            targets = json.loads(metadata["regolithd.targets"])
            self.version = metadata["regolithd.version"]
            self.radius_m = float(metadata["regolithd.radius_m"])
            if tuple(target["name"] for target in targets) != TARGETS:
                raise PosteriorModelError(f"{path}: its targets are not {', '.join(TARGETS)}, in this order. {REMEDY}")
            self._centre = np.array([float(target["centre"]) for target in targets])
            self._unit = np.array([float(target["unit"]) for target in targets])
        except (KeyError, ValueError, TypeError) as error:
            raise PosteriorModelError(f"{path}: its metadata are not a posterior's: {error}. {REMEDY}") from error
        self._run_once(path)

    def _run_once(self, path: Path) -> None:
        """Run it on one empty window, so that a model that does not fit is refused at the start."""
        zeros = {
            each.name: np.zeros([size if isinstance(size, int) else 1 for size in each.shape], np.float32)
            for each in self._session.get_inputs()
        }
        try:
            (raw,) = self._session.run(None, zeros)
            unpack(raw, self._centre, self._unit)
        except Exception as error:  # onnxruntime's errors have no common class
            raise PosteriorModelError(f"{path}: does not run on a window: {error}. {REMEDY}") from error

    def mixtures(self, windows: Windows) -> Mixture:
        """Return the posterior of each window."""
        inputs = {"wheels": windows.wheels, "mask": windows.mask, "known": windows.known}
        (raw,) = self._session.run(None, {name: value.astype(np.float32) for name, value in inputs.items()})
        return unpack(raw, self._centre, self._unit)

    def fall_probability(
        self, before: Array, after: Array, uncertainty: CalibrationUncertainty
    ) -> FallProbability | None:
        """Return the probability that each quantity decreased from one window to another; None if either is empty.

        Windows have shape (3, instants, 6). The errors of gain and no-load current, which both windows share, are taken
        as independent: this biases the probabilities towards one half.
        """
        if not (_usable(before).any() and _usable(after).any()):
            return None
        samples = [
            self.mixtures(self._reduce(window, uncertainty)).sample(_SAMPLES, np.random.default_rng(_SEED + k))[0]
            for k, window in enumerate((before, after))
        ]
        return FallProbability(*np.mean(samples[1] < samples[0], axis=0).tolist())

    def estimate(self, window: Array, uncertainty: CalibrationUncertainty) -> Posterior | None:
        """Return the posterior given a window of shape (3, instants, 6); None where no wheel was measured."""
        usable = _usable(window)
        if not usable.any():
            return None
        windows = self._reduce(window, uncertainty)
        mixture = self.mixtures(windows)
        means, quantiles = mixture.means()[0], mixture.quantiles(np.array(LEVELS))[0]
        cohesion, angle, margin = (
            Interval(float(mean), *map(float, row)) for mean, row in zip(means, quantiles, strict=True)
        )
        return Posterior(cohesion, angle, margin, int(windows.mask.sum()), int(np.any(usable, axis=1).sum()))

    def _reduce(self, window: Array, uncertainty: CalibrationUncertainty) -> Windows:
        load, slip, torque = window[:, None]
        return reduce_windows(load, slip, torque, uncertainty.deviations(), self.radius_m, uncertainty.soil_index())


def _usable(window: Array) -> NDArray[np.bool_]:
    """Return where load, slip and torque were all measured, shape (instants, 6)."""
    return np.logical_and.reduce(np.isfinite(window))
