"""Delay of the soil-change alarm from sandy loam to LETE sand at one false alarm in 8 h, compared with three baselines.

The baselines use the cohesion by the paper's network, averaged over the six wheels: its value at one half second, its
mean over 10 s, and the difference of that mean from the mean over the two minutes before. The threshold of each method
is set on the same drives over one soil, with slopes, to the same rate of false alarms; further alarms within a minute
are not counted.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import SOILS, Wheel
from regolithd.calibration.posterior import change_detection as change
from regolithd.calibration.posterior.window import INTERVAL_S
from regolithd.calibration.validation.estimators import paper_network
from regolithd.calibration.validation.estimators.simulated_drives import Instant, SimulatedDrive, instants, torque_curve

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

Array = NDArray[np.float64]

CASES = {"": (0.0, 5.0), "_correlated": (0.5, 5.0), "_flat": (0.0, 0.0)}
"""Correlation time of the noise [s] and amplitude of the slopes [°]: white noise, correlated noise, level ground."""

METHODS = ("cusum", "paper_instant", "paper_10_s", "paper_shift")
EIGHT_HOURS = round(8 * 3600 / INTERVAL_S)
DEAD_TIME = 120
"""Half seconds after an alarm in which further ones are not counted."""

_CHANGE_AT = 500
_AFTER = 400


@dataclass(frozen=True, slots=True, eq=False)
class SingleSoilDrives:
    """Drives over one soil: the highest statistic of each minute, shape (minutes, rovers), for each method."""

    peaks: dict[str, Array]
    half_seconds: int


def statistics(drive: SimulatedDrive, length: int, rng: np.random.Generator) -> Iterator[dict[str, Array]]:
    """Yield each method's statistic, shape (rovers,), for each half second; high values raise the alarm."""
    expected = torque_curve(SOILS[drive.first], Wheel())
    state = change.start((drive.rovers,))
    recent: deque[Array] = deque(maxlen=20)
    reference: deque[Array] = deque(maxlen=220)
    for instant in instants(drive, length, rng):
        state, cusum = change.step(state, instant.torque_Nm, expected(instant.load_N, instant.slip))
        recent.append(-_paper_cohesion(instant))
        reference.append(recent[0])
        mean_10_s = np.mean(recent, axis=0)
        yield {
            "cusum": cusum,
            "paper_instant": recent[-1],
            "paper_10_s": mean_10_s,
            "paper_shift": np.abs(mean_10_s - np.mean(reference, axis=0)),
        }


def _paper_cohesion(instant: Instant) -> Array:
    estimates = paper_network.estimate(instant.load_N, instant.slip, instant.current_A)
    return np.ascontiguousarray(estimates[..., 0]).mean(axis=1).astype(np.float64)


def single_soil_drives(
    drive: SimulatedDrive, hours: float, rng: np.random.Generator, progress: Callable[[int], None] = lambda _: None
) -> SingleSoilDrives:
    """Simulate drives of `hours` over one soil; `progress` is called with the number of finished half seconds."""
    length = round(hours * 3600 / INTERVAL_S) // DEAD_TIME * DEAD_TIME
    peaks: dict[str, list[Array]] = {name: [] for name in METHODS}
    for k, values in enumerate(statistics(drive, change.SETTLING + length, rng)):
        if k < change.SETTLING:
            continue
        for name, value in values.items():
            if (k - change.SETTLING) % DEAD_TIME == 0:
                peaks[name].append(value)
            else:
                peaks[name][-1] = np.maximum(peaks[name][-1], value)
        progress(drive.rovers)
    return SingleSoilDrives({name: np.stack(rows) for name, rows in peaks.items()}, length * drive.rovers)


def false_alarms(drives: SingleSoilDrives, method: str, threshold: float) -> float:
    """Return the number of false alarms in 8 h: minutes above the threshold that follow a minute below it."""
    above = drives.peaks[method] > threshold
    first = above & ~np.vstack([np.zeros_like(above[:1]), above[:-1]])
    return float(first.sum() * EIGHT_HOURS / drives.half_seconds)


def threshold(drives: SingleSoilDrives, method: str, alarms_in_8_h: float = 1.0) -> float:
    """Return the lowest threshold with at most this number of false alarms in 8 h."""
    candidates = np.sort(drives.peaks[method].ravel())[::-1]
    low, high = 0, len(candidates) // 4
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (
            (middle, high) if false_alarms(drives, method, candidates[middle]) <= alarms_in_8_h else (low, middle)
        )
    return float(candidates[low])


def delays(drive: SimulatedDrive, thresholds: dict[str, float], rng: np.random.Generator) -> dict[str, Array]:
    """Return the delay from the front axle's crossing to the alarm [s], shape (rovers,), for each method.

    It is ∞ without an alarm, and NaN for a rover with a false alarm in the minute before the crossing.
    """
    delay = {name: np.full(drive.rovers, np.inf) for name in thresholds}
    at = drive.change_at or 0
    for k, values in enumerate(statistics(drive, at + _AFTER, rng)):
        if k < at - DEAD_TIME:
            continue
        for name, limit in thresholds.items():
            now = np.where(values[name] > limit, (k - at + 1) * INTERVAL_S, np.inf)
            delay[name] = np.minimum(delay[name], now)
    return {name: np.where(value <= 0, np.nan, value) for name, value in delay.items()}


def figures(
    rovers: int, hours: float, seed: int, progress: Callable[[int], None] = lambda _: None
) -> tuple[dict[str, float], dict[str, Array]]:
    """Return the figures of all `CASES`, and the delays they are computed from."""
    rng = np.random.default_rng(seed)
    out: dict[str, float] = {}
    samples: dict[str, Array] = {}
    for case, (correlation_time_s, slope) in CASES.items():
        drives = single_soil_drives(
            SimulatedDrive(rovers, correlation_time_s=correlation_time_s, slope_deg=slope), hours, rng, progress
        )
        limits = {name: threshold(drives, name) for name in METHODS}
        for name in METHODS:
            out[f"{name}_threshold{case}"] = -limits[name] if name in {"paper_instant", "paper_10_s"} else limits[name]
            out[f"{name}_false_alarms_in_8_h{case}"] = false_alarms(drives, name, limits[name])
        for crossing, at_once in {"": True, "_by_axle": False}.items():
            drive = SimulatedDrive(
                rovers, _CHANGE_AT, at_once=at_once, correlation_time_s=correlation_time_s, slope_deg=slope
            )
            for name, delay in delays(drive, limits, rng).items():
                key = f"{name}_delay{crossing}{case}"
                samples[key] = delay[~np.isnan(delay)]
                out[f"{key}_median_s"] = float(np.median(samples[key]))
                out[f"{key}_90_percent_s"] = float(np.quantile(samples[key], 0.9, method="higher"))
                out[f"{key}_missed"] = float(np.mean(np.isinf(samples[key])))
    out["null_hours"] = rovers * hours
    return out, samples
