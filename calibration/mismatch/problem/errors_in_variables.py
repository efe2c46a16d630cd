"""Errors in variables: noisy inputs replaced by their conditional expectation (regression calibration).

The error of an input biases the prediction and every candidate that is computed from the same reading, in the same
way: the residual correlates with candidates though no physics is missing. Replacing a reading by E[truth | recording]
removes this; the error that remains is of Berkson's kind, uncorrelated with what is computed from it (Carroll et al.,
2006, chapter 4). The truth is modelled as first-order autoregressive about its mean, with the correlation of the
recording, so that a signal that jumps is hardly smoothed. With a stated error of 0 nothing changes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.prior import SensorError

Array = NDArray[np.float64]


def expected_inputs(recording: Recording, sensors: Mapping[str, SensorError]) -> Recording:
    """Return the recording with each input that has an error replaced by its conditional expectation."""
    names = [
        name for name, error in sensors.items() if name in recording.channels and (error.relative or error.absolute)
    ]
    if not names:
        return recording
    values = np.concatenate([recording.channels[name] for name in names], axis=1)
    scale = [
        sensors[name].absolute + sensors[name].relative * float(known_mean(np.abs(column)))
        for name in names
        for column in recording.channels[name].T
    ]
    starts = np.flatnonzero(np.diff(recording.run, prepend=recording.run[0] - 1))
    smooth = conditional_expectation(values, np.array(scale) ** 2, starts)
    parts = np.split(smooth, len(names), axis=1)
    return recording.with_channels(**dict(zip(names, parts, strict=True)))


def known_mean(values: Array, axis: int = 0) -> Array:
    """Return the mean over the finite values along an axis; 0 where there are none."""
    known = np.isfinite(values)
    return np.asarray(np.sum(np.where(known, values, 0.0), axis=axis) / np.maximum(known.sum(axis=axis), 1))


def conditional_expectation(values: Array, error_variance: Array, starts: NDArray[np.int64]) -> Array:
    """Smooth columns of noisy readings, shape (time, column), by a Kalman filter run forwards and backwards.

    `error_variance` [per column] is the readings' error; `starts` are the instants where a run begins anew.
    NaN stays NaN; the filter predicts across it.
    """
    known = np.isfinite(values)
    mean = np.array([np.mean(c[k]) if k.any() else 0.0 for c, k in zip(values.T, known.T, strict=True)])
    centred = np.where(known, values - mean, 0.0)
    persistence, variance = _autoregression(centred, known, error_variance)
    estimate, spread, predicted = _filtered(centred, known, persistence, variance, error_variance, set(starts.tolist()))
    smooth = estimate.copy()
    for t in range(len(values) - 2, -1, -1):
        if t + 1 in starts:
            continue
        gain = spread[t] * persistence / predicted[t + 1]
        smooth[t] += gain * (smooth[t + 1] - persistence * estimate[t])
    return np.where(known, smooth + mean, np.nan)


def _autoregression(centred: Array, known: NDArray[np.bool_], error_variance: Array) -> tuple[Array, Array]:
    """Return the truth's lag-one correlation and variance.

    Half the mean square of increments is the error plus what the truth moved. The lag is the shortest at which the
    truth moves as much as the error does: there the two can be told apart, and the truth's speed is read off.
    """
    total = np.sum(centred**2, axis=0) / np.maximum(known.sum(axis=0), 1)
    variance = np.maximum(total - error_variance, 1e-3 * total + 1e-300)
    moved = np.full(total.shape, np.nan)
    for lag in 2 ** np.arange(int(np.log2(max(len(centred) // 4, 2)))):
        both = known[lag:] & known[:-lag]
        steps = np.where(both, centred[lag:] - centred[:-lag], 0.0)
        half = 0.5 * np.sum(steps**2, axis=0) / np.maximum(both.sum(axis=0), 1) - error_variance
        # γ(lag) = variance (1 − persistence^lag)
        decay = np.clip(1 - half / variance, 1e-6, 1 - 1e-9) ** (1 / lag)
        moved = np.where(np.isnan(moved) & (half > error_variance), decay, moved)
    return np.where(np.isnan(moved), 1 - 1e-3, moved), variance


def _filtered(
    centred: Array, known: NDArray[np.bool_], persistence: Array, variance: Array, error: Array, starts: set[int]
) -> tuple[Array, Array, Array]:
    """Return the filter's estimates, their variances, and the variances before each reading."""
    estimate, spread, predicted = (np.empty_like(centred) for _ in range(3))
    innovation = (1 - persistence**2) * variance
    state, doubt = np.zeros_like(variance), variance.copy()
    for t in range(len(centred)):
        if t in starts:
            state, doubt = np.zeros_like(variance), variance
        elif t:
            state, doubt = persistence * state, persistence**2 * doubt + innovation
        predicted[t] = doubt
        gain = np.where(known[t], doubt / (doubt + error + 1e-300), 0.0)
        state = state + gain * (centred[t] - state)
        doubt = (1 - gain) * doubt
        estimate[t], spread[t] = state, doubt
    return estimate, spread, predicted
