"""How soon the alarm notices sandy loam turning into LETE sand, at one false alarm in 8 h; beside the paper's network.

The rivals watch the paper network's cohesion, averaged over the six wheels: a fall at one half second; a fall of the
last 10 s; and a shift, either way, of the last 10 s against the two minutes before. Each method's threshold is set on
the same drives over one soil, slopes and all, to the same rate of false alarms; an alarm is counted again only after a
minute without one.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from regolithd.calibration.models import TERRAIN_MODEL
from regolithd.calibration.parameters import SOILS, Wheel
from regolithd.calibration.posterior import change_detection as change
from regolithd.calibration.posterior.window import INTERVAL_S
from regolithd.calibration.validation.estimators.traverse import Drive, Instant, instants, torque_curve

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

Array = NDArray[np.float64]

CASES = {"": (0.0, 5.0), "_correlated": (0.5, 5.0), "_flat": (0.0, 0.0)}
"""Memory of the noise [s] and slope [°]: as asked; with harder noise; and on ground as flat as the paper's."""

METHODS = ("cusum", "paper_instant", "paper_10_s", "paper_shift")
EIGHT_HOURS = round(8 * 3600 / INTERVAL_S)
QUIET = 120
"""Half seconds without an alarm, before another is counted."""

_CHANGE_AT = 500
_AFTER = 400


@dataclass(frozen=True, slots=True, eq=False)
class NullDrives:
    """The highest statistic of each minute of drives over one soil: shape (minutes, rovers) for each method."""

    peaks: dict[str, Array]
    half_seconds: int


def statistics(drive: Drive, length: int, rng: np.random.Generator) -> Iterator[dict[str, Array]]:
    """Yield each method's statistic, shape (rovers,), for each half second; high is alarming."""
    session = onnxruntime.InferenceSession(TERRAIN_MODEL)
    expected = torque_curve(SOILS[drive.first], Wheel())
    state = change.start((drive.rovers,))
    recent: deque[Array] = deque(maxlen=20)
    usual: deque[Array] = deque(maxlen=220)
    for instant in instants(drive, length, rng):
        state, cusum = change.step(state, instant.torque_Nm, expected(instant.load_N, instant.slip))
        recent.append(-_paper_cohesion(session, instant))
        usual.append(recent[0])
        lately = np.mean(recent, axis=0)
        yield {
            "cusum": cusum,
            "paper_instant": recent[-1],
            "paper_10_s": lately,
            "paper_shift": np.abs(lately - np.mean(usual, axis=0)),
        }


def _paper_cohesion(session: onnxruntime.InferenceSession, instant: Instant) -> Array:
    inputs = np.stack([instant.load_N, instant.slip, instant.current_A], axis=-1)
    (answer,) = session.run(None, {"inputs": inputs.reshape(-1, 3).astype(np.float32)})
    return answer[:, 0].reshape(instant.load_N.shape).mean(axis=1).astype(np.float64)


def null_drives(
    drive: Drive, hours: float, rng: np.random.Generator, progress: Callable[[int], None] = lambda _: None
) -> NullDrives:
    """Drive `hours` with each rover over one soil."""
    length = round(hours * 3600 / INTERVAL_S) // QUIET * QUIET
    peaks: dict[str, list[Array]] = {name: [] for name in METHODS}
    for k, values in enumerate(statistics(drive, change.SETTLING + length, rng)):
        if k < change.SETTLING:
            continue
        for name, value in values.items():
            if (k - change.SETTLING) % QUIET == 0:
                peaks[name].append(value)
            else:
                peaks[name][-1] = np.maximum(peaks[name][-1], value)
        progress(drive.rovers)
    return NullDrives({name: np.stack(rows) for name, rows in peaks.items()}, length * drive.rovers)


def false_alarms(null: NullDrives, method: str, threshold: float) -> float:
    """Return false alarms in 8 h: minutes above the threshold that follow a minute below it."""
    above = null.peaks[method] > threshold
    fresh = above & ~np.vstack([np.zeros_like(above[:1]), above[:-1]])
    return float(fresh.sum() * EIGHT_HOURS / null.half_seconds)


def threshold(null: NullDrives, method: str, alarms_in_8_h: float = 1.0) -> float:
    """Return the lowest threshold that gives no more false alarms than asked for."""
    candidates = np.sort(null.peaks[method].ravel())[::-1]
    low, high = 0, len(candidates) // 4
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if false_alarms(null, method, candidates[middle]) <= alarms_in_8_h else (low, middle)
    return float(candidates[low])


def delays(drive: Drive, thresholds: dict[str, float], rng: np.random.Generator) -> dict[str, Array]:
    """Return seconds from the front axle's meeting the new soil to the alarm, shape (rovers,); ∞ where it never came.

    A rover on which the method had already raised a false alarm in the minute before does not count: NaN.
    """
    begun = {name: np.full(drive.rovers, np.inf) for name in thresholds}
    at = drive.change_at or 0
    for k, values in enumerate(statistics(drive, at + _AFTER, rng)):
        if k < at - QUIET:
            continue
        for name, limit in thresholds.items():
            now = np.where(values[name] > limit, (k - at + 1) * INTERVAL_S, np.inf)
            begun[name] = np.minimum(begun[name], now)
    return {name: np.where(value <= 0, np.nan, value) for name, value in begun.items()}


def figures(
    rovers: int, hours: float, seed: int, progress: Callable[[int], None] = lambda _: None
) -> tuple[dict[str, float], dict[str, Array]]:
    """Return the figures, and the delays they are of: all of `CASES`."""
    rng = np.random.default_rng(seed)
    out: dict[str, float] = {}
    samples: dict[str, Array] = {}
    for case, (memory, slope) in CASES.items():
        null = null_drives(Drive(rovers, memory_s=memory, slope_deg=slope), hours, rng, progress)
        limits = {name: threshold(null, name) for name in METHODS}
        for name in METHODS:
            out[f"{name}_threshold{case}"] = -limits[name] if name in {"paper_instant", "paper_10_s"} else limits[name]
            out[f"{name}_false_alarms_in_8_h{case}"] = false_alarms(null, name, limits[name])
        for crossing, at_once in {"": True, "_by_axle": False}.items():
            drive = Drive(rovers, _CHANGE_AT, at_once=at_once, memory_s=memory, slope_deg=slope)
            for name, delay in delays(drive, limits, rng).items():
                key = f"{name}_delay{crossing}{case}"
                samples[key] = delay[~np.isnan(delay)]
                out[f"{key}_median_s"] = float(np.median(samples[key]))
                out[f"{key}_90_percent_s"] = float(np.quantile(samples[key], 0.9, method="higher"))
                out[f"{key}_missed"] = float(np.mean(np.isinf(samples[key])))
    out["null_hours"] = rovers * hours
    return out, samples
