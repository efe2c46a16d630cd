"""What a driver can set: the channel behind each covariate, and the values that it may have in an experiment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.predictor import complete_inputs

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

NOT_SET = frozenset({"time", "place", "wheel_row"})
"""Covariates that a driver cannot set, or that nothing is a function of alone: what happens later, or elsewhere."""
MAGNITUDES = frozenset({"wheel_speed", "load", "torque", "slip"})
"""Covariates that have a size; half and one and a half times the usual one can be set (`SMALLEST`, `LARGEST`)."""
SMALLEST, LARGEST = 0.5, 1.5
"""Sizes that an experiment can set at least, over the median of the recording (a choice: most machines have them)."""
USUAL_QUANTILES = (0.02, 0.98)
"""Ends of what a recording has had of a covariate, single readings aside (a choice)."""
PROBES, REACH = 33, 0.5
"""Values of a channel at which a covariate is tried, and how far they reach from its median, over the median."""
LINEAR_TO = 1e-6
"""Share of a covariate's change that may be no linear function of a channel which sets it: rounding."""
LEAST_RESPONSE = 1e-3
"""Relative change of a prediction below which a channel does not set it (a choice)."""
SAME_SHARE = 0.95
"""Share of the sampled rows whose prediction is the same in any order, where there is no state (a choice)."""
SAMPLED_ROWS = 64
"""Rows that are predicted alone, to see whether a prediction depends on the rows before."""
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Setting:
    """A covariate that can be set through one channel: covariate = intercept + slope × channel.

    Attributes
    ----------
    covariate: its name
    channel: of the recording as the simulation gets it
    slope, intercept: shape (wheel,)
    low, high: the values that an experiment may have; of a covariate that changes sign with the direction, magnitudes
    relative: whether the values are shares of the channel's usual reading
    """

    covariate: str
    channel: str
    slope: Array
    intercept: Array
    low: float
    high: float
    relative: bool = False

    def channel_at(self, values: Array) -> Array:
        """Return the channel, shape (time, wheel), where the covariate has these values, shape (time, 1)."""
        return (values - self.intercept) / self.slope


def settings_of(problem: Problem, covariates: Iterable[str]) -> dict[str, Setting]:
    """Return how those of the covariates are set that depend on one channel alone, and linearly.

    The torque is set through the channel that changes the prediction most; it is left out where that channel's own
    covariate is among the others.
    """
    known = {**problem.covariates, **problem.constants}.keys() - NOT_SET
    wanted = [name for name in dict.fromkeys(covariates) if name in known]
    medians = usual_inputs(problem)
    found: dict[str, Setting] = {}
    for channel in medians:
        if channel in {"t_s", "run", problem.simulation.channel}:
            continue
        probe, covariates_there = _probed(problem, medians, channel)
        for name in wanted:
            if name not in found and name in covariates_there:
                setting = _linear(problem, name, channel, probe, covariates_there[name])
                if setting is not None:
                    found[name] = setting
    if "torque" in wanted and "torque" not in found and "load" not in found:
        speed = found["wheel_speed"].channel if "wheel_speed" in found else None
        if (by_load := _load_like(problem, medians, speed)) is not None:
            found["torque"] = by_load
    return {name: found[name] for name in wanted if name in found}


def usual_inputs(problem: Problem) -> dict[str, Array]:
    """Return every input's median on each wheel where readings are compared, shape (wheel,)."""
    found = {}
    for name, values in complete_inputs(problem.recording).items():
        known = np.where(problem.mask, values, np.nan)
        empty = ~np.isfinite(known).any(axis=0)
        known[:, empty] = 0.0 if np.all(empty) else np.nanmedian(known)
        found[name] = np.asarray(np.nanmedian(known, axis=0), np.float64)
    return found


def predicts_row_by_row(problem: Problem) -> bool:
    """Return whether a prediction depends on its own row alone, so that any inputs can be put together.

    Some rows are predicted in the reverse order, at ascending times: what integrates over time gives something else
    nearly everywhere. Few may differ: `direction_of` has the noise at standstill of the rows that it is given.
    """
    rows = np.unique(np.linspace(0, len(problem.mask) - 1, SAMPLED_ROWS).astype(np.int64))
    inputs = {name: values[rows[::-1]] for name, values in complete_inputs(problem.recording).items()}
    inputs |= {name: inputs[name][::-1] for name in ("t_s", "run")}
    values = {**problem.simulation.variants(), **problem.values}
    with np.errstate(all="ignore"):
        alone = problem.simulation.predict(inputs, values)[::-1]
    known = problem.mask[rows]
    apart = np.abs(alone - (problem.prediction - problem.added - problem.error_bias)[rows])[known]
    return bool(np.mean(apart <= ROUNDING * max(problem.mean_size, 1e-300)) >= SAME_SHARE)


def _probed(problem: Problem, medians: Mapping[str, Array], channel: str) -> tuple[Array, dict[str, Array]]:
    """Return values of a channel about its median, and the covariates there, each of shape (probe, wheel)."""
    middle = medians[channel]
    reach = np.where(middle == 0, 1.0, REACH * np.abs(middle))
    probe = middle + np.linspace(-1, 1, PROBES)[:, None] * reach
    inputs = {name: np.broadcast_to(values, probe.shape).copy() for name, values in medians.items()}
    inputs["t_s"] = np.broadcast_to(np.arange(float(PROBES))[:, None], probe.shape).copy()
    inputs[channel] = probe
    return probe, dict(problem.simulation.covariates(inputs))


def _linear(problem: Problem, name: str, channel: str, probe: Array, values: Array) -> Setting | None:
    """Return the setting of a covariate by a channel; None where the channel does not set it, or not linearly."""
    if not np.isfinite(values).all():
        return None
    centred = probe - probe.mean(axis=0)
    slope = np.sum(centred * (values - values.mean(axis=0)), axis=0) / np.sum(centred**2, axis=0)
    intercept = values.mean(axis=0) - slope * probe.mean(axis=0)
    change = np.ptp(values, axis=0)
    left = np.max(np.abs(values - intercept - slope * probe), axis=0)
    if np.any(change == 0) or np.any(left > LINEAR_TO * change):
        return None
    covariate = {**problem.covariates, **problem.constants}[name]
    ends = _ends(problem, name, covariate)
    return None if ends is None else Setting(name, channel, slope, intercept, *ends)


def _load_like(problem: Problem, medians: Mapping[str, Array], speed: str | None) -> Setting | None:
    """Return the setting of the torque by the channel that changes the prediction most."""
    shape = (2, problem.mask.shape[1])
    inputs = {name: np.broadcast_to(values, shape).copy() for name, values in medians.items()}
    values = {**problem.simulation.variants(), **problem.values}
    usual = np.abs(problem.simulation.predict(inputs, values))
    best, channel = LEAST_RESPONSE, None
    for name, middle in medians.items():
        if name in {"t_s", "run", problem.simulation.channel, speed} or not np.all(middle > 0):
            continue
        more = np.abs(problem.simulation.predict({**inputs, name: inputs[name] * LARGEST}, values))
        response = float(np.nan_to_num(np.mean((more - usual) / np.maximum(usual, 1e-300))))
        if response > best:
            best, channel = response, name
    if channel is None:
        return None
    one = np.ones(problem.mask.shape[1])
    # The torque as a share of the usual one: what the channel reads over its median.
    return Setting("torque", channel, one / medians[channel], 0 * one, SMALLEST, LARGEST, relative=True)


def _ends(problem: Problem, name: str, values: Array) -> tuple[float, float] | None:
    """Return between which values an experiment may set a covariate; None where nothing says how to vary it."""
    known = values[problem.mask & np.isfinite(values)]
    if not known.size:
        return None
    if name in MAGNITUDES:
        known = np.abs(known)
        known = known[known > 0] if np.any(known > 0) else known  # a standstill is no size
    middle = float(np.median(known))
    low, high = (float(each) for each in np.quantile(known, USUAL_QUANTILES))
    if name in MAGNITUDES:
        low, high = min(low, SMALLEST * middle), max(high, LARGEST * middle)
    span = float(problem.simulation.experiment_spans.get(name, 0.0))
    high = max(high, middle + span)
    if name not in MAGNITUDES or middle > span:  # a size below 0 is none, and one of 0 is a standstill
        low = min(low, middle - span)
    return (low, high) if high - low > ROUNDING * max(abs(low), abs(high)) else None
