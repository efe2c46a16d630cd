"""Covariates: what a residual may be ordered by, measured or derived from what was measured."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.intermittency.stretches import stretches

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]

FOLLOW_SPEED = ("direction", "wheel_acceleration", "wheel_angle")
"""Covariates that are derived from `wheel_speed`, or completed by it."""
KEPT_WHERE_CONSTANT = frozenset({"wheel_speed", *FOLLOW_SPEED, "time", "torque"})
"""Covariates that candidates need even where they are constant."""
UNIT_WORD = re.compile(r"[munkM]?(A|V|N|Nm|W|J|m|s|g|Pa|Hz|bar|l|mol)[23]?|K|deg[CF]?|rad[2]?|min|h|rpm|per|percent|mL")
"""A part of a column's name that is of its unit: `A` of `current_A`, `m` and `s` of `flow_m_s`."""
LITRES = re.compile(r"(.+?)_(L_(min|h|s|kg)|[mun]?(g|mol)_L(_(min|h|s|kg))?)")
"""A name with litres in its unit: `flow_L_min`, and not `speed_L_rad_s`, which is on the left."""
SLOW_SHARE = 0.05
"""Share of the highest usual speed below which an axis may stand (a choice): no more of it is noise of a speed sensor
that is of use."""
USUAL_SPEED_QUANTILE = 0.98
"""Quantile of the magnitudes of a speed that counts as the highest usual one (a choice)."""
STANDSTILL_DEVIATIONS = 3.0
"""Standard deviations of its noise within which a speed has no sign: 1 reading in 370 of an axis that stands is beyond
(normal density)."""
ONE_STD_QUANTILE = 0.6827
"""Quantile of a normal magnitude at one standard deviation."""
LEVEL_READINGS = 9
"""Slow readings one after the other in the middle of which noise is looked for (a choice): those beside fast ones are
the ends of ramps, which bend by more than the noise where they are sampled coarsely."""
STANDING_READINGS = 5
"""Readings one after the other within a smoothed speed's noise from which an axis stands (a choice): a reversal is
through in fewer."""
MOST_LEFT = 0.5
"""Share of the noise's variance up to which a speed is smooth (a choice: splines leave less, autoregressions more)."""
MOST_EXACT = 0.5
"""Share of the readings within the noise of a speed from which on, being exactly 0, they are the standstill (a choice:
a sensor with noise reads exactly 0 by chance in few)."""
ALTERNATING_SHARE = 0.15
"""Share of the highest usual speed below which what alternates is noise (a choice: with three standard deviations of a
noise that reaches further, hardly a start or stop would be left)."""
FEWEST_ALTERNATIONS = 3
"""Alternations about 0 from which they are noise (a choice: one may be a machine that was nudged)."""


def covariates_of(
    recording: Recording,
    simulation: Predictor,
    inputs: Mapping[str, Array],
    prediction: Array,
    as_read: Mapping[str, Array] | None = None,
    *,
    arbitrary_zero: bool = False,
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return what was measured and varies, with what follows from it; and what was measured but is one number.

    `as_read` are the inputs before they were smoothed, where they were: a smoothed speed is never quite zero. A
    prediction with an `arbitrary_zero` is no covariate.
    """
    found = dict(simulation.covariates(inputs))
    found["time"] = np.broadcast_to(_elapsed(recording)[:, None], recording.shape)
    if not arbitrary_zero:
        # Torque is what something that turns carries; of anything else the prediction is the quantity that it is.
        found.setdefault("torque" if "wheel_speed" in found else quantity(simulation.channel), np.abs(prediction))
    if "wheel_speed" in found and np.isfinite(found["wheel_speed"]).any():
        speed = found["wheel_speed"]
        read = speed if as_read is None else simulation.covariates(as_read)["wheel_speed"]
        found["direction"] = _direction(speed, read)
        rate, angle = _derivative(speed, recording), _integral(speed, recording)
        given = found.get("wheel_acceleration", rate)
        found["wheel_acceleration"] = np.where(np.isfinite(given), given, rate)
        if "wheel_angle" in found:
            found["wheel_angle"] = _measured_angle(found["wheel_angle"], angle)
            found.setdefault("position", found["wheel_angle"])  # of limited travel a measured angle is a position
        else:
            found["wheel_angle"] = angle
    measured = {name: values for name, values in found.items() if np.isfinite(values).any()}
    varying = {name: values for name, values in found.items() if name in KEPT_WHERE_CONSTANT or _varies(values)}
    return varying, {name: values for name, values in measured.items() if name not in varying}


def direction_of(speed: Array, std: float | None = None) -> Array:
    """Return the sign of a speed (time, wheel); 0 where it is within the noise that the sensor has at standstill.

    An axis that stands reads a little more or less than zero. The sign of that is no direction: no friction reverses
    with it. NaN stays NaN. `std` is the noise's standard deviation in the unit of the speed, where it is known. Else it
    is estimated from the readings that are given, so give whole recordings.
    """
    directions = [_sign_beyond(column, _reach(column, std)) for column in speed.T]
    return np.where(np.isfinite(speed), np.stack(directions, axis=1), np.nan)


def _direction(speed: Array, read: Array) -> Array:
    """Return the sign of a speed (time, wheel), smoothed or as it was `read`; 0 where an axis stands.

    The noise at standstill is that of the readings. Of its variance, smoothing leaves what it does not take out. Where
    that is little, a speed has a sign also on its way from one direction to the other.
    """
    if speed is read:
        return direction_of(read)
    signs = []
    for smooth, column in zip(speed.T, read.T, strict=True):
        reach = _noise_at_standstill(column)
        taken_out = float(np.nanmean((column - smooth) ** 2)) if np.isfinite(column - smooth).any() else 0.0
        left = max(1 - taken_out / (reach / STANDSTILL_DEVIATIONS) ** 2, 0.0) if reach else 0.0
        if left > MOST_LEFT:
            signs.append(_sign_beyond(column, reach))
        else:
            signs.append(np.where(_stays_within(smooth, np.sqrt(left) * reach), 0.0, np.sign(smooth)))
    return np.where(np.isfinite(speed), np.stack(signs, axis=1), np.nan)


def _reach(speed: Array, std: float | None) -> float:
    """Return how far from zero a speed (time,) has no sign."""
    return _noise_at_standstill(speed) if std is None else STANDSTILL_DEVIATIONS * std


def _noise_at_standstill(speed: Array) -> float:
    """Return the reach of a speed's noise (time,) about zero, by its second differences while it stays slow.

    These are free of a constant speed and of a ramp through zero. Where most of what is within that reach is exactly 0,
    the axis reads 0 while it stands (a dead band, a speed that is set to 0 while a brake holds): the others are the
    ends of motions, which bend, and have a sign. There, where a standstill is short, and where the noise reaches
    further than what is slow, it is that of readings with a sign that neither neighbour has: only noise goes +, −, +,
    or 0, +, 0. The reading in the middle tells it; at a stop of one reading the neighbours are ramps. At most the share
    of the usual speed.
    """
    known = speed[np.isfinite(speed)]
    usual = float(np.quantile(np.abs(known), USUAL_SPEED_QUANTILE)) if known.size else 0.0
    reach = 0.0
    level = _stays_below(speed, SLOW_SHARE * usual, LEVEL_READINGS)
    if level.any():
        second = np.abs(np.diff(speed, 2))[level[1:-1]]
        deviation = float(np.quantile(second, ONE_STD_QUANTILE)) / np.sqrt(6)  # variance 1 + 4 + 1
        reach = min(STANDSTILL_DEVIATIONS * deviation, SLOW_SHARE * usual)
        within = known[np.abs(known) <= reach]
        if np.sum(within == 0) > MOST_EXACT * within.size:
            reach = 0.0
    alternating = np.abs(speed[_alternates(speed) & _stays_below(speed, ALTERNATING_SHARE * usual, 3)])
    if alternating.size >= FEWEST_ALTERNATIONS:
        deviation = float(np.quantile(alternating, ONE_STD_QUANTILE))
        reach = max(reach, min(STANDSTILL_DEVIATIONS * deviation, ALTERNATING_SHARE * usual))
    return reach


def _alternates(speed: Array) -> NDArray[np.bool_]:
    """Return which readings (time,) have a sign that neither the one before nor the one after has: that, or none."""
    turned = np.concatenate(([False], speed[:-1] * speed[1:] <= 0, [False]))
    return turned[:-1] & turned[1:] & (speed != 0)


def _stays_below(speed: Array, limit: float, count: int) -> NDArray[np.bool_]:
    """Return in the middle of which `count` readings, an odd number, all are slower than a limit, shape (time,)."""
    found = np.zeros(speed.shape, dtype=bool)
    if len(speed) >= count:
        found[count // 2 : len(speed) - count // 2] = sliding_window_view(np.abs(speed) < limit, count).all(axis=1)
    return found


def _sign_beyond(speed: Array, reach: float) -> Array:
    """Return the sign of a speed (time,), 0 within a reach of 0."""
    return np.where(np.abs(speed) > reach, np.sign(speed), 0.0)


def _stays_within(speed: Array, reach: float) -> NDArray[np.bool_]:
    """Return where a speed (time,) is within a reach of 0, and stays so for some readings."""
    within = np.abs(speed) <= reach
    for first, last in stretches(within):
        if last - first < STANDING_READINGS:
            within[first:last] = False
    return within


def names_of_prediction(channel: str) -> tuple[str, str]:
    """Return what the size of the prediction of a channel is called among the covariates: either of these."""
    return "torque", quantity(channel)


def quantity(channel: str) -> str:
    """Return a channel's name without the unit at its end: `load` of `load_N` and of `load_kN`."""
    if found := LITRES.fullmatch(channel):
        return found[1]
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
    whole = recording.without_gap & (steps > 0)
    rate = np.where(whole[:, None], ahead / np.where(whole, steps, 1.0)[:, None], 0.0)
    before, after = np.vstack((rate[:1] * 0, rate)), np.vstack((rate, rate[:1] * 0))
    return np.nan_to_num(0.5 * (before + after))


def _measured_angle(measured: Array, integrated: Array) -> Array:
    """Return measured angles (time, wheel), blanks on straight lines; of a wheel without any, the integrated angle.

    One that never changes is that of a drive that the simulation predicts with its usual inputs, not a measured one.
    """
    found = np.array(integrated)
    for k, column in enumerate(measured.T):
        known = np.flatnonzero(np.isfinite(column))
        if _varies(column):
            found[:, k] = np.interp(np.arange(len(column)), known, column[known])
    return found


def angle_is_recorded(recording: Recording, covariates: Mapping[str, Array]) -> bool:
    """Return whether the angle was measured: one that is integrated begins anew in each recording."""
    return not np.array_equal(covariates["wheel_angle"], _integral(covariates["wheel_speed"], recording))


def _integral(values: Array, recording: Recording) -> Array:
    """Return the angle turned since the start (trapezium); a gap is bridged, its angle is not known."""
    steps = np.diff(recording.time_s)
    steps = np.where((np.diff(recording.run) == 0) & (steps > 0), steps, 0.0)
    known = np.nan_to_num(values)
    return np.vstack(
        (np.zeros((1, values.shape[1])), np.cumsum(0.5 * (known[1:] + known[:-1]) * steps[:, None], axis=0))
    )
