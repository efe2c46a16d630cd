"""CUSUM detector of a change of soil, from half-second means of torque, load and slip.

The measured torque is compared with the torque that the wheel–soil model predicts for the load and slip of the same
half second, scaled by the ratio of measured to predicted torque over the last minutes (the reference). Slopes, which
change load and slip, are therefore part of the prediction. The residual is standardised and clipped to 2.5 standard
deviations, which limits the weight of a momentary drop of current. CUSUMs [1]_ are computed for decrease and increase;
for all wheels, the front axle, and front and middle axles, since the front wheels enter new soil first; and for two
sizes of change. The variance and lag-1 correlation of the noise are estimated and corrected for.

The detector is a pure function: `step` takes a state and returns the next, for one rover or, with leading axes, many.

References
----------
.. [1] E. S. Page, "Continuous inspection schemes", Biometrika 41 (1954) 100–115.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.posterior.window import INTERVAL_S

Array = NDArray[np.float64]

WHEEL_GROUPS = np.array([[1, 1, 1, 1, 1, 1], [1, 1, 0, 0, 0, 0], [1, 1, 1, 1, 0, 0]], np.float64)
GROUP_NAMES = ("all", "front", "front-and-middle")
CHANGE_SIZES = np.array([0.5, 1.0])
"""Changes that the CUSUMs are tuned to, in standard deviations of a half second's mean over the group."""

CLIP = 2.5
"""Standardised residuals are clipped to ± this."""
LAG = 40
"""Delay of the reference in half seconds, so that it does not follow a change at once."""

FORGETTING = 240.0
"""Time constant of the exponential forgetting of the reference, in half seconds."""

THRESHOLD = 10.8
"""CUSUM at which an alarm is raised: one false alarm in 8 h over one soil, with slopes and drops of current
(`regolithd evaluate`)."""

SETTLING = 240
"""Half seconds before the first alarm is possible: the lag, and 100 s of reference."""

FALL, RISE = -1.0, 1.0


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """State of the detector; leading axes are rovers.

    Attributes
    ----------
    torque, expected
        Shape (LAG, …, 6): measured and predicted torque of the half seconds that are not yet in the reference.
    sum_torque, sum_expected, deviation
        Shape (…, 6): the reference: exponentially weighted sums, and the mean absolute deviation.
    last, product, square
        Shape (…, 3): last value and exponentially weighted lag-1 and lag-0 products, for the correlation.
    sums
        Shape (…, 2, 3, 2): the CUSUMs; axes direction (fall, rise), group, size.
    since
        Shape (…, 2, 3, 2): half seconds since each CUSUM was zero.
    age
        Shape (…): half seconds since the start.
    """

    torque: Array
    expected: Array
    sum_torque: Array
    sum_expected: Array
    deviation: Array
    last: Array
    product: Array
    square: Array
    sums: Array
    since: Array
    age: Array


@dataclass(frozen=True, slots=True)
class Alarm:
    """A detected change of soil, and its statistic."""

    time_ns: int
    onset_ns: int
    direction: str
    group: str
    statistic: float
    threshold: float
    torque_ratio: float
    """Torque since the onset over the torque by the reference for the same load and slip [1]."""


def start(rovers: tuple[int, ...] = ()) -> State:
    """Return the state before the first half second."""
    six, groups, sums = (*rovers, 6), (*rovers, 3), (*rovers, 2, 3, 2)
    return State(
        torque=np.full((LAG, *six), np.nan),
        expected=np.full((LAG, *six), np.nan),
        sum_torque=np.zeros(six),
        sum_expected=np.zeros(six),
        deviation=np.zeros(six),
        last=np.zeros(groups),
        product=np.zeros(groups),
        square=np.full(groups, 1e-9),
        sums=np.zeros(sums),
        since=np.zeros(sums),
        age=np.zeros(rovers),
    )


def step(state: State, torque_Nm: Array, expected_Nm: Array) -> tuple[State, Array]:
    """Process one half second.

    Parameters
    ----------
    state
        State before it.
    torque_Nm, expected_Nm
        Measured torque, and that of the wheel–soil model [N·m], shape (…, 6); NaN for a wheel without measurement.

    Returns
    -------
    tuple
        The next state, and the largest CUSUM, shape (…).
    """
    slot = int(np.max(state.age)) % LAG if state.age.size else 0
    leaving, leaving_expected = state.torque[slot], state.expected[slot]
    reference = _update_reference(state, leaving, leaving_expected)
    ratio = reference.sum_torque / np.maximum(reference.sum_expected, 1e-9)
    scale = 1.2533 * reference.deviation + 1e-9
    residual = np.clip((torque_Nm - ratio * expected_Nm) / scale, -CLIP, CLIP)
    known = np.isfinite(residual) & (reference.sum_expected > 0)
    # Weight of a wheel: its torque in standard deviations, since a change of soil scales the torque.
    weight = np.where(known, ratio * expected_Nm / scale, 0.0)
    residual = np.where(known, residual, 0.0)
    level = (weight * residual) @ WHEEL_GROUPS.T / np.sqrt(np.maximum(weight**2 @ WHEEL_GROUPS.T, 1e-9))
    reference = _update_correlation(reference, level)
    correlation = np.clip(reference.product / np.maximum(reference.square, 1e-9), 0.0, 0.8)
    level = level / np.sqrt(np.maximum(reference.square, 0.25) * (1 + correlation) / (1 - correlation))
    sums, since = _update_cusums(state, level)
    torque, expected = state.torque.copy(), state.expected.copy()
    torque[slot], expected[slot] = torque_Nm, expected_Nm
    age = state.age + 1
    settled = age[..., None, None, None] > SETTLING
    sums, since = np.where(settled, sums, 0.0), np.where(settled, since, 0.0)
    following = replace(reference, torque=torque, expected=expected, sums=sums, since=since, age=age)
    return following, sums.max(axis=(-3, -2, -1))


def _update_reference(state: State, torque_Nm: Array, expected_Nm: Array) -> State:
    """Add the half second that leaves the lag to the reference."""
    known = np.isfinite(torque_Nm) & np.isfinite(expected_Nm)
    keep = np.where(known, 1 - 1 / FORGETTING, 1.0)
    sum_torque = keep * state.sum_torque + np.where(known, torque_Nm, 0.0)
    sum_expected = keep * state.sum_expected + np.where(known, expected_Nm, 0.0)
    away = np.abs(np.where(known, torque_Nm - sum_torque / np.maximum(sum_expected, 1e-9) * expected_Nm, 0.0))
    # Plain average at first, exponential forgetting later.
    seen = np.clip(state.age[..., None] - LAG, 1, FORGETTING)
    deviation = np.where(known, state.deviation + (away - state.deviation) / seen, state.deviation)
    return replace(state, sum_torque=sum_torque, sum_expected=sum_expected, deviation=deviation)


def _update_correlation(state: State, level: Array) -> State:
    learning = (state.age > LAG)[..., None]
    share = 1 / np.clip(state.age[..., None] - LAG, 1, 2 * FORGETTING)
    product = np.where(learning, state.product + share * (level * state.last - state.product), state.product)
    square = np.where(learning, state.square + share * (level**2 - state.square), state.square)
    return replace(state, last=level, product=product, square=square)


def _update_cusums(state: State, level: Array) -> tuple[Array, Array]:
    signed = np.stack([FALL * level, RISE * level], axis=-2)[..., None]
    sums = np.maximum(state.sums + CHANGE_SIZES * (signed - CHANGE_SIZES / 2), 0.0)
    return sums, np.where(sums > 0, state.since + 1, 0.0)


def alarm(state: State, time_ns: int, threshold: float = THRESHOLD) -> Alarm | None:
    """Return the alarm if the largest CUSUM of one rover's state has reached the threshold, else None."""
    where = np.unravel_index(int(np.argmax(state.sums)), state.sums.shape)
    statistic = float(state.sums[where])
    if statistic < threshold:
        return None
    ago = int(state.since[where])
    slots = (int(state.age) - 1 - np.arange(min(ago, LAG))) % LAG
    wheels = WHEEL_GROUPS[where[1]] > 0
    torque, expected = state.torque[slots][:, wheels], state.expected[slots][:, wheels]
    reference = state.sum_torque[wheels] / np.maximum(state.sum_expected[wheels], 1e-9) * expected
    return Alarm(
        time_ns=time_ns,
        onset_ns=time_ns - int(ago * INTERVAL_S * 1e9),
        direction=("fall", "rise")[int(where[0])],
        group=GROUP_NAMES[int(where[1])],
        statistic=statistic,
        threshold=threshold,
        torque_ratio=float(np.nansum(torque) / np.nansum(reference)),
    )
