"""The posterior on the rover: the last seconds of six wheels in, intervals of cohesion, friction angle and margin out.

NumPy and onnxruntime only. A `Buffer` collects measurements and hands out the window; a `PosteriorEstimator` runs the
network on it. Neither reads a clock: time comes with the measurements, so that a replay gives the same numbers.

What comes out is the posterior under the prior of `soils`: as wide as the data leave it. One instant of one wheel says
little more than the prior, and the intervals show it.
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
    LONGEST,
    CalibrationUncertainty,
    Windows,
    reduce_windows,
)

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Array = NDArray[np.float64]

"""The posterior network that comes with regolithd."""

LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
"""The quantiles that are told: of the 90 % interval, of the 50 % interval, and the median."""

WHEELS = 6
_SAMPLES = 4000
_SEED = 20


CURE = "Train one (`regolithd train-posterior`), or mend [posterior] model."


class PosteriorModelError(ModelError):
    """A file's network is not a posterior as the daemon needs it."""


@dataclass(frozen=True, slots=True)
class Interval:
    """One quantity's posterior: mean, and the quantiles of `LEVELS`. SI units."""

    mean: float
    low_90: float
    low_50: float
    median: float
    high_50: float
    high_90: float


@dataclass(frozen=True, slots=True)
class Posterior:
    """The posterior of the soil under the rover, given one window of measurements."""

    cohesion_Pa: Interval
    friction_angle_rad: Interval
    drawbar_margin: Interval
    wheels: int
    instants: int


@dataclass(frozen=True, slots=True)
class FallProbability:
    """How likely it is that each quantity fell between two windows: the evidence of an alarm."""

    cohesion: float
    friction_angle: float
    drawbar_margin: float


@dataclass(slots=True)
class Buffer:
    """The last `length_s` seconds of measurements, in half-second means; the state is all here.

    Faster samples are averaged over each half second; a wheel that turned round or stood still is NaN there.
    """

    length_s: float = 10.0
    _closed: deque[Array] = field(default_factory=deque)
    _open: list[Array] = field(default_factory=list)
    _slot: int | None = None

    def add(self, time_ns: int, load_N: Array, slip: Array, torque_Nm: Array) -> bool:
        """Take one snapshot's load, slip and driving torque, each of shape (6,); say whether a half second closed."""
        slot = time_ns // int(INTERVAL_S * 1e9)
        closed = self._slot is not None and slot != self._slot
        if closed:
            self._close()
        if self._slot is not None and not 0 <= slot - self._slot <= self.instants:
            self._closed.clear()  # a gap as long as the window, or a clock that was set back: begin anew
        self._slot = slot
        self._open.append(np.stack([load_N, slip, torque_Nm]).astype(np.float64))
        return closed

    @property
    def instants(self) -> int:
        """Return how many half seconds a full window has."""
        return max(1, min(LONGEST, round(self.length_s / INTERVAL_S)))

    def window(self) -> Array:
        """Return load, slip and torque of the closed half seconds, shape (3, instants, 6); may be empty."""
        return np.stack(self._closed, axis=1) if self._closed else np.empty((3, 0, WHEELS))

    def _close(self) -> None:
        values = np.stack(self._open)
        known = np.isfinite(values)
        count = known.sum(axis=0)
        total = np.where(known, values, 0.0).sum(axis=0)
        self._closed.append(np.where(count > 0, total / np.maximum(count, 1), np.nan))
        self._open.clear()
        while len(self._closed) > self.instants:
            self._closed.popleft()


class PosteriorEstimator:
    """The posterior network, ready to run."""

    def __init__(self, path: Path = POSTERIOR_MODEL) -> None:
        self._session = open_session(path, CURE)
        if {each.name: each.shape[-1] for each in self._session.get_inputs()}.get("known") != KNOWN:
            raise PosteriorModelError(f"{path}: was trained with other inputs. {CURE}")
        metadata: Mapping[str, str] = self._session.get_modelmeta().custom_metadata_map
        try:
            targets = json.loads(metadata["regolithd.targets"])
            self.version = metadata["regolithd.version"]
            self.radius_m = float(metadata["regolithd.radius_m"])
            if tuple(target["name"] for target in targets) != TARGETS:
                raise PosteriorModelError(f"{path}: its targets are not {', '.join(TARGETS)}, in this order. {CURE}")
            self._centre = np.array([float(target["centre"]) for target in targets])
            self._unit = np.array([float(target["unit"]) for target in targets])
        except (KeyError, ValueError, TypeError) as error:
            raise PosteriorModelError(f"{path}: its metadata are not a posterior's: {error}. {CURE}") from error

    def mixtures(self, windows: Windows) -> Mixture:
        """Return the posterior of each window."""
        inputs = {"wheels": windows.wheels, "mask": windows.mask, "known": windows.known}
        (raw,) = self._session.run(None, {name: value.astype(np.float32) for name, value in inputs.items()})
        return unpack(raw, self._centre, self._unit)

    def fall_probability(
        self, before: Array, after: Array, uncertainty: CalibrationUncertainty
    ) -> FallProbability | None:
        """Return how likely each quantity fell from one window, (3, instants, 6), to another; None if either is empty.

        The two windows share the errors of gain and no-load current, which are counted in each as if they were not
        shared: the probabilities err towards one half.
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
        return reduce_windows(load, slip, torque, uncertainty.deviations(), self.radius_m, uncertainty.told())


def _usable(window: Array) -> NDArray[np.bool_]:
    """Return where load, slip and torque were all measured, shape (instants, 6)."""
    return np.logical_and.reduce(np.isfinite(window))
