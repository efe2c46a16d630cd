"""An alarm when the soil under the rover changes, from the same half-second means as the posterior's.

Torque is compared with what the wheel–soil model says for the load and slip of the instant, scaled to how the last
minutes went: so slope, which changes load and slip, is in the expectation and not in the evidence. What remains is
standardised, cut at 2.5 standard deviations so that one momentary drop of current weighs no more than that, and
summed up in a CUSUM (Page 1954) for a fall and a rise: of all six wheels, of the front axle, and of front and middle,
since a rover enters new soil with its front wheels first; and for two sizes of change. The noise's correlation is
measured and allowed for.

The state is a value: `step` takes one and returns the next, for one rover or, with leading axes, for many at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.posterior.window import INTERVAL_S

Array = NDArray[np.float64]

GROUPS = np.array([[1, 1, 1, 1, 1, 1], [1, 1, 0, 0, 0, 0], [1, 1, 1, 1, 0, 0]], np.float64)
GROUP_NAMES = ("all", "front", "front-and-middle")
SIZES = np.array([0.5, 1.0])
"""The changes that the sums are made for, in standard deviations of a half second's mean over the group."""

CUT = 2.5
LAG = 40
"""Half seconds that the reference stays behind, so that a change does not become its own reference at once."""

MEMORY = 240.0
"""Half seconds over which the reference forgets."""

THRESHOLD = 10.8
"""One false alarm in 8 h of driving over one soil, slopes and drops of current and all (`regolithd evaluate`)."""

SETTLING = 240
"""Half seconds before the first alarm: the lag, and 100 s of reference."""

FALL, RISE = -1.0, 1.0


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """All that the detector remembers; leading axes are rovers.

    Attributes
    ----------
    torque, expected
        Shape (LAG, …, 6): the half seconds not yet in the reference.
    sum_torque, sum_expected, deviation
        Shape (…, 6): the reference: forgetting sums, and the mean absolute deviation.
    last, product, square
        Shape (…, 3, 2): the last value and the forgetting lag-1 and lag-0 products, for the correlation.
    sums
        Shape (…, 2, 3, 2): the CUSUMs; directions (fall, rise), groups, sizes.
    since
        Shape (…, 2, 3, 2): half seconds since each sum left zero.
    age
        Shape (…): half seconds since the start, or the last alarm.
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
    """A change of soil, and what speaks for it."""

    time_ns: int
    onset_ns: int
    direction: str
    group: str
    statistic: float
    threshold: float
    torque_ratio: float
    """Torque since the onset, over what the reference expects for the same load and slip."""


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
    """Take one half second of torque and the model's, shape (…, 6); return the next state and the largest sum.

    A wheel that was not measured is NaN in either, and says nothing.
    """
    slot = int(np.max(state.age)) % LAG if state.age.size else 0
    leaving, leaving_expected = state.torque[slot], state.expected[slot]
    reference = _learn(state, leaving, leaving_expected)
    ratio = reference.sum_torque / np.maximum(reference.sum_expected, 1e-9)
    scale = 1.2533 * reference.deviation + 1e-9
    away = np.clip((torque_Nm - ratio * expected_Nm) / scale, -CUT, CUT)
    known = np.isfinite(away) & (reference.sum_expected > 0)
    # A wheel counts by how many standard deviations the whole torque is: that much a change can move it.
    weight = np.where(known, ratio * expected_Nm / scale, 0.0)
    away = np.where(known, away, 0.0)
    level = (weight * away) @ GROUPS.T / np.sqrt(np.maximum(weight**2 @ GROUPS.T, 1e-9))
    reference = _correlate(reference, level)
    kept = np.clip(reference.product / np.maximum(reference.square, 1e-9), 0.0, 0.8)
    level = level / np.sqrt(np.maximum(reference.square, 0.25) * (1 + kept) / (1 - kept))
    sums, since = _accumulate(state, level)
    torque, expected = state.torque.copy(), state.expected.copy()
    torque[slot], expected[slot] = torque_Nm, expected_Nm
    age = state.age + 1
    settled = age[..., None, None, None] > SETTLING
    sums, since = np.where(settled, sums, 0.0), np.where(settled, since, 0.0)
    following = replace(reference, torque=torque, expected=expected, sums=sums, since=since, age=age)
    return following, sums.max(axis=(-3, -2, -1))


def _learn(state: State, torque_Nm: Array, expected_Nm: Array) -> State:
    """Take the half second that leaves the lag into the reference."""
    known = np.isfinite(torque_Nm) & np.isfinite(expected_Nm)
    keep = np.where(known, 1 - 1 / MEMORY, 1.0)
    sum_torque = keep * state.sum_torque + np.where(known, torque_Nm, 0.0)
    sum_expected = keep * state.sum_expected + np.where(known, expected_Nm, 0.0)
    away = np.abs(np.where(known, torque_Nm - sum_torque / np.maximum(sum_expected, 1e-9) * expected_Nm, 0.0))
    # The first deviations are averages of what there is; later ones forget as the sums do.
    seen = np.clip(state.age[..., None] - LAG, 1, MEMORY)
    deviation = np.where(known, state.deviation + (away - state.deviation) / seen, state.deviation)
    return replace(state, sum_torque=sum_torque, sum_expected=sum_expected, deviation=deviation)


def _correlate(state: State, level: Array) -> State:
    learning = (state.age > LAG)[..., None]
    share = 1 / np.clip(state.age[..., None] - LAG, 1, 2 * MEMORY)
    product = np.where(learning, state.product + share * (level * state.last - state.product), state.product)
    square = np.where(learning, state.square + share * (level**2 - state.square), state.square)
    return replace(state, last=level, product=product, square=square)


def _accumulate(state: State, level: Array) -> tuple[Array, Array]:
    signed = np.stack([FALL * level, RISE * level], axis=-2)[..., None]
    sums = np.maximum(state.sums + SIZES * (signed - SIZES / 2), 0.0)
    return sums, np.where(sums > 0, state.since + 1, 0.0)


def alarm(state: State, time_ns: int, threshold: float = THRESHOLD) -> Alarm | None:
    """Return the alarm that one rover's state amounts to, or None."""
    where = np.unravel_index(int(np.argmax(state.sums)), state.sums.shape)
    statistic = float(state.sums[where])
    if statistic < threshold:
        return None
    ago = int(state.since[where])
    slots = (int(state.age) - 1 - np.arange(min(ago, LAG))) % LAG
    wheels = GROUPS[where[1]] > 0
    torque, expected = state.torque[slots][:, wheels], state.expected[slots][:, wheels]
    usual = state.sum_torque[wheels] / np.maximum(state.sum_expected[wheels], 1e-9) * expected
    return Alarm(
        time_ns=time_ns,
        onset_ns=time_ns - int(ago * INTERVAL_S * 1e9),
        direction=("fall", "rise")[int(where[0])],
        group=GROUP_NAMES[int(where[1])],
        statistic=statistic,
        threshold=threshold,
        torque_ratio=float(np.nansum(torque) / np.nansum(usual)),
    )
