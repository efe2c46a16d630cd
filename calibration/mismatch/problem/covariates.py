"""Covariates: what a residual may be ordered by, measured or derived from what was measured."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]

KEPT_WHERE_CONSTANT = frozenset({"wheel_speed", "direction", "wheel_acceleration", "wheel_angle", "time", "torque"})
"""Covariates that candidates need even where they are constant."""
UNIT_WORD = re.compile(r"[munkM]?(A|V|N|Nm|W|J|m|s|g|Pa|Hz|bar|l)[23]?|K|deg[CF]?|rad[2]?|min|h|rpm|per|percent")
"""A part of a column's name that is of its unit: `A` of `current_A`, `m` and `s` of `flow_m_s`."""
LONGEST_STEP = 3.0
"""Steps of time longer than so many usual ones are gaps: nothing is differentiated across them."""


def covariates_of(
    recording: Recording, simulation: Predictor, inputs: Mapping[str, Array], prediction: Array
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return what was measured and varies, with what follows from it; and what was measured but is one number."""
    found = dict(simulation.covariates(inputs))
    found["time"] = np.broadcast_to(_elapsed(recording)[:, None], recording.shape)
    if not simulation.arbitrary_zero:
        # Torque is what something that turns carries; of anything else the prediction is the quantity that it is.
        found.setdefault("torque" if "wheel_speed" in found else quantity(simulation.channel), np.abs(prediction))
    if "wheel_speed" in found:
        speed = found["wheel_speed"]
        found["direction"] = np.sign(speed)
        found["wheel_acceleration"] = _derivative(speed, recording)
        found["wheel_angle"] = _integral(speed, recording)
    measured = {name: values for name, values in found.items() if np.isfinite(values).any()}
    varying = {name: values for name, values in found.items() if name in KEPT_WHERE_CONSTANT or _varies(values)}
    return varying, {name: values for name, values in measured.items() if name not in varying}


def quantity(channel: str) -> str:
    """Return a channel's name without the unit at its end: `load` of `load_N` and of `load_kN`."""
    words = channel.split("_")
    while len(words) > 1 and UNIT_WORD.fullmatch(words[-1]):
        words.pop()
    return "_".join(words)


def _varies(values: Array) -> bool:
    """Return whether a covariate was measured at all, and is not one number."""
    known = values[np.isfinite(values)]
    return bool(known.size) and float(np.ptp(known)) > 1e-12 * float(np.max(np.abs(known)))


def _elapsed(recording: Recording) -> Array:
    """Return seconds with all runs put one after the other, shape (time,)."""
    steps = np.diff(recording.time_s, prepend=recording.time_s[0])
    steps[np.flatnonzero(np.diff(recording.run)) + 1] = recording.step_s
    return np.cumsum(steps)


def _derivative(values: Array, recording: Recording) -> Array:
    """Return the rate of change by central differences; 0 across gaps and between runs."""
    ahead = np.diff(values, axis=0)
    steps = np.diff(recording.time_s)
    whole = (np.diff(recording.run) == 0) & (steps < LONGEST_STEP * recording.step_s) & (steps > 0)
    rate = np.where(whole[:, None], ahead / np.where(whole, steps, 1.0)[:, None], 0.0)
    before, after = np.vstack((rate[:1] * 0, rate)), np.vstack((rate, rate[:1] * 0))
    return np.nan_to_num(0.5 * (before + after))


def _integral(values: Array, recording: Recording) -> Array:
    """Return the angle turned since the start (trapezium); a gap is bridged, its angle is not known."""
    steps = np.diff(recording.time_s)
    steps = np.where((np.diff(recording.run) == 0) & (steps > 0), steps, 0.0)
    known = np.nan_to_num(values)
    return np.vstack(
        (np.zeros((1, values.shape[1])), np.cumsum(0.5 * (known[1:] + known[:-1]) * steps[:, None], axis=0))
    )
