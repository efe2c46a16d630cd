"""One channel is late: it reports what was some time ago, or follows it through a filter."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import SHAPE_TOLERANCE, Array, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.candidates.lag_scan import best_lag
from regolithd.calibration.mismatch.candidates.late_columns import (
    DEAD_TIME,
    KINDS,
    OF_CHANNEL,
    OF_INPUT,
    SENSOR_DELAY,
    bridged,
)
from regolithd.calibration.mismatch.problem.delayed import restart_of, shifted
from regolithd.calibration.mismatch.signal.intermittency.stretches import stretches

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem

FINEST_READINGS = 2.0
"""Shortest delay in the grid, in readings (a choice)."""
LEAST_READINGS = 1.25
"""Shortest delay that is named, in readings: what a sampled input does between two readings is not recorded, and a
solver that holds it, or interpolates it, is early or late by up to one (a choice: a quarter of a reading more)."""
PASSED = "passed"
"""The shape parameter of the share of the predicted change that was recorded."""
PASSED_STD, PASSED_STD_OF_INPUT = 0.2, 0.025
"""Standard deviation of that share about 1, for the predicted channel and for an input (a choice: inputs whose noise is
a fifth of the change's power; a late input itself is smoothed by its stated error first, and then its size is that
of other effects, by `size_discrepancy_std`)."""
LEAST_PASSED = 0.5
"""That share, or its reciprocal, below which something else than a delay is fitted; and the ratio of an input's delay
to that which its change was computed for (a choice; the grid's ratio of 4 is the square of its reciprocal)."""
RATIO_OF_CHANNEL, RATIO_OF_INPUT = 2.0, 4.0
"""Ratio of neighbouring delays in the grid, for the predicted channel and for an input (a choice: a fitted delay is
refined from the nearest; each delay of an input costs a run of the simulation)."""
UNIFORM_STD = 0.29
"""Standard deviation of what is even over one unit: 1/√12."""
LONGEST_SHARE = 0.1
"""The longest delay, as a share of the recording (a choice: a longer one is a wrong clock, which is seen at once)."""


class SensorDelay(Candidate):
    """The predicted channel, or one of the simulation's inputs, is late by a constant time.

    The predicted channel is late by a dead time (a bus, polling), or by the time constant of a first-order filter,
    which is how late it is on a ramp: one before it is read, or an exponential smoothing of the readings. The change of
    the prediction is exact for the shape's own delay (no Taylor series); per second of delay, so that the coefficient
    is the delay. Both are optimised together, since a delay shows in when the column steps. How far it steps is
    predicted from inputs with errors: `passed` is the share of the predicted change that was recorded, 1 ± 0.2 before
    the recording (1 ± 0.025 of an input, which is smoothed by its stated error first) and from a half to two after it.
    The delay of an input costs a run of the simulation for each whole reading; between them the change is interpolated.

    What acts on the machine shows as late as the predicted channel is: once that is named, all else is searched for
    again, late by as much. Once an input's delay is named, all else is searched for with that input on time.

    A delay of less than 1.25 readings has no name, since a sampled input does not say what it was between two readings:
    what it changes stays unexplained. `shape.late` is the column that is late; the effect's `channel` is the predicted
    one, in which that shows.
    """

    name = SENSOR_DELAY
    covariate = "time"
    equation = "y(t) = y_true(t − τ), or τ dy/dt = y_true − y"
    words = "a delay of one column"
    signature = "a residual proportional to the rate of change of one channel"
    experiment = "change the inputs (speed, load) in steps, up and down, twenty times"
    source = "filters, buses and polling: a first-order filter delays slow changes by its time constant"
    along_motion = False
    imitated_over = "none"
    late_with_channel = False
    forms = ("dead time", "first-order filter", "exponential smoothing")
    coefficients: ClassVar = (Coefficient("delay_s", "s", 1),)
    shape_keys: ClassVar = {
        "late": "the column that is late",
        "secant_s": "dead time of the predicted channel",
        "filter_s": "time constant of its first-order filter",
        "smoothing_s": "time constant of an exponential smoothing of its readings",
        OF_INPUT: "dead time of an input",
        PASSED: "share of the predicted change that was recorded (without the key: 1)",
    }
    free: ClassVar = dict.fromkeys(("secant_s", "filter_s", "smoothing_s", OF_INPUT), (0.0, float("inf")))

    scaled_by = PASSED

    def __init__(self, not_of: frozenset[str] = frozenset()) -> None:
        """Make the candidate, of all columns but these."""
        self._not_of = not_of

    def beside(self, corrected: Sequence[Shape]) -> SensorDelay:
        """Return the delay of the other columns: each may be late by itself."""
        return self.without({str(shape["late"]) for shape in corrected if "late" in shape})

    def without(self, columns: Iterable[str]) -> SensorDelay:
        """Return the delay of the other columns."""
        return SensorDelay(self._not_of | frozenset(columns))

    def words_for(self, shape: Shape) -> str:
        """Return which column is late."""
        return f"a delay of {shape['late']}" if "late" in shape else self.words

    def form_of(self, shape: Shape) -> str:
        """Return what delays the column; an input is tried as late by a dead time."""
        of_channel = dict(zip(OF_CHANNEL, self.forms, strict=True))
        return next((form for kind, form in of_channel.items() if kind in shape), self.forms[0])

    def shapes(self, problem: Problem) -> Sequence[Shape]:
        """Return the predicted channel and each input, late by two readings up to a tenth of the recording.

        A delay by which the problem has the channel, or an input, late already is among them.
        """
        simulation, late = problem.simulation, dict([problem.late] if problem.late else [])
        of_channel: list[Shape] = [
            {"late": simulation.channel, kind: delay}
            for kind in OF_CHANNEL
            for delay in _delays(problem, RATIO_OF_CHANNEL, late.get(kind))
        ]
        of_inputs: list[Shape] = [
            {"late": name, OF_INPUT: delay}
            for name in simulation.inputs
            for delay in _delays(problem, RATIO_OF_INPUT, problem.on_time.get(name))
        ]
        return [shape for shape in (*of_channel, *of_inputs) if shape["late"] not in self._not_of]

    def propose_shapes(self, problem: Problem, residual: Array) -> Sequence[Shape]:
        """Return each input at the delay that the residual fits best to first order.

        The grid is too coarse for delays that are longer than the input takes to change.
        """
        most = int(LONGEST_SHARE * problem.length_s / problem.recording.step_s)
        known = {*problem.on_time, *self._not_of}
        inputs = [name for name in problem.simulation.inputs if name not in known]
        lags = {
            name: best_lag(problem, problem.recording.channels[name], _slope(problem, name), residual, most)
            for name in inputs
        }
        return [
            {"late": name, OF_INPUT: readings * problem.recording.step_s}
            for name, readings in lags.items()
            if readings >= FINEST_READINGS
        ]

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return the prediction's change for this delay of this channel, over the delay."""
        for kind in OF_CHANNEL:
            if kind in shape:
                delay = float(shape[kind])
                restart = None if kind == DEAD_TIME else restart_of(problem, delay)
                behind = OF_CHANNEL[kind](problem.recording, _without_blanks(problem, delay), delay, restart)
                return (float(shape.get(PASSED, 1.0)) * (behind - problem.prediction) / delay)[None]
        late, delay = str(shape["late"]), float(shape[OF_INPUT])
        return (float(shape.get(PASSED, 1.0)) * _change(problem, late, delay) / delay)[None]

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:  # noqa: ARG002
        """Return delays from a fraction of a reading to the longest."""
        return dict.fromkeys(KINDS, (0.1 * problem.recording.step_s, LONGEST_SHARE * problem.length_s))

    def search_range(
        self, problem: Problem, shape: Shape, name: str, bounds: tuple[float, float]
    ) -> tuple[float, float]:
        """Return where to optimise the delay: from half to twice that of the grid."""
        del problem
        at = float(shape[name])
        return max(bounds[0], at / RATIO_OF_CHANNEL), min(bounds[1], at * RATIO_OF_CHANNEL)

    def resolution(self, problem: Problem) -> float:
        """Return a reading: what is interpolated on straight lines has a corner at each."""
        return problem.recording.step_s

    def left_open(self, problem: Problem, name: str) -> float:
        """Return half a reading for an input, evenly: a simulation may hold it between readings, or interpolate."""
        return UNIFORM_STD * problem.recording.step_s if name == OF_INPUT else 0.0

    def parameters(self, shape: Shape, values: Sequence[float]) -> dict[str, float]:
        """Return the delay of the shape, since the coefficient has the share passed."""
        return {"delay_s": next((float(shape[kind]) for kind in KINDS if kind in shape), float(values[0]))}

    def plausible(self, problem: Problem, shape: Shape, values: Sequence[float]) -> bool:
        """Return whether the delay is more than sampling itself leaves open, and about that of its shape.

        Of the predicted channel, it shows in changes of about the predicted size.
        """
        share = float(shape.get(PASSED, 1.0))
        if OF_INPUT in shape and PASSED not in shape:
            share = float(values[0]) / float(shape[OF_INPUT])
        return values[0] >= LEAST_READINGS * problem.recording.step_s and LEAST_PASSED <= share <= 1 / LEAST_PASSED

    def stated_coefficient(self, shape: Shape) -> tuple[float, float] | None:
        """Return the coefficient at which all of the change was recorded, and how well that share is known to be 1."""
        passed = float(shape.get(PASSED, 1.0))
        std = PASSED_STD_OF_INPUT if OF_INPUT in shape else PASSED_STD
        return next(((float(shape[kind]) / passed, std) for kind in KINDS if kind in shape), None)

    def shape_at(self, shape: Shape, value: float) -> Shape:
        """Return the shape with the share of the predicted change that was recorded."""
        delay = next(float(shape[kind]) for kind in KINDS if kind in shape)
        return {**shape, PASSED: float(shape.get(PASSED, 1.0)) * value / delay}

    def self_consistent_shape(self, problem: Problem, shape: Shape, values: Sequence[float]) -> Shape:
        """Return the shape at the fitted delay, with the same share of the change."""
        name = next(name for name in KINDS if name in shape)
        delay = float(np.clip(values[0], *self.bounds(problem, shape)["secant_s"]))
        before = float(shape[name])
        return shape if abs(delay - before) < SHAPE_TOLERANCE * before else {**shape, name: delay}


def _change(problem: Problem, name: str, delay_s: float) -> Array:
    """Return the prediction's change with an input on time that is late by so much, shape (time, wheel).

    A column is on a straight line between two readings: so is the change between two delays of whole readings, which
    are counted from the delay that the problem has on time.
    """
    already, step = problem.on_time.get(name, 0.0), problem.recording.step_s
    whole, part = divmod((delay_s - already) / step, 1.0)
    # Of several late inputs each has its own change, of the recording with those before it as they were recorded:
    # together they are what all of them change.
    before = list(problem.on_time)[: list(problem.on_time).index(name)] if already else []
    recorded = {each: moved_input(problem, each, -problem.on_time[each]) for each in before}

    def moved(readings: float) -> Array:
        if not (readings or recorded):
            return problem.filled
        further = {**recorded, name: moved_input(problem, name, readings * step)}
        known_as = f"{name} late, and {before} as recorded" if before else f"{name} late"
        return problem.run_once(known_as, already + readings * step, lambda: problem.with_inputs(further))

    found = moved(whole) if not part else (1 - part) * moved(whole) + part * moved(whole + 1)
    if len(problem.on_time) > 1 and already:
        return np.asarray(found - moved(-already / step))
    return np.asarray(found - (problem.as_simulated if already else problem.filled))


def moved_input(problem: Problem, name: str, earlier_s: float) -> Array:
    """Return an input as it would have been recorded so much earlier [s], shape (time, wheel).

    One that is put on time on some wheels, on these.
    """
    values, on = problem.recording.channels[name], problem.on_time_on.get(name, ())
    return shifted(problem.recording, values, earlier_s, on)


def _slope(problem: Problem, name: str) -> Array:
    """Return ∂prediction/∂input at each instant, shape (time, wheel); 0 for an input that does not vary."""
    values = problem.recording.channels[name]
    step = problem.thresholds.tangent_step * float(np.nanstd(values))
    if not step > 0:
        return np.zeros(problem.mask.shape)
    return problem.run_once(
        f"slope with {name}", step, lambda: (problem.with_input(name, values + step) - problem.filled) / step
    )


def _delays(problem: Problem, ratio: float, known: float | None) -> list[float]:
    """Return the delays of the grid [s]: a geometric series, and the one that the problem has already."""
    shortest, longest = FINEST_READINGS * problem.recording.step_s, LONGEST_SHARE * problem.length_s
    count = int(np.log(max(longest / shortest, 1.0)) / np.log(ratio) + 1e-9) + 1
    return sorted({*(shortest * ratio ** np.arange(count)).tolist(), *filter(None, [known])})


def _without_blanks(problem: Problem, delay_s: float) -> Array:
    """Return the prediction; where the simulation says nothing for long, the median of what was recorded there.

    What a late channel reports just after a standstill is what it would have reported at standstill: as it does once
    the delay has passed. A straight line bridges what is shorter than two delays, or was not recorded either. A
    simulation that says nothing near standstill would say there what it says beside, as long as the motion goes on.
    """
    late = int(np.ceil(delay_s / problem.recording.step_s))
    found = np.array(problem.prediction)
    direction = problem.covariates.get("direction", np.zeros_like(found))
    for k in range(found.shape[1]):
        blank = np.isnan(found[:, k])
        for first, end in stretches(blank):
            standing = _standing(direction[:, k], first, end)
            found[first : standing.start, k] = found[max(first - 1, 0), k]
            found[standing.stop : end, k] = found[min(end, len(found) - 1), k]
            recorded = problem.measured[standing.start + late : standing.stop, k]
            if standing.stop - standing.start >= 2 * late and np.isfinite(recorded).any():
                found[standing, k] = np.nanmedian(recorded)
    return bridged(found)


def _standing(direction: Array, first: int, end: int) -> slice:
    """Return the part of a blank without the rows in which the axis still moves as before it, or already as after it.

    The whole blank where the direction does not change in it: then it is no standstill. Between a motion and a rest of
    which the simulation says something, the axis moves, too slowly for a direction.
    """
    before, after = direction[max(first - 1, 0)], direction[min(end, len(direction) - 1)]
    if (before == 0) != (after == 0):
        return slice(first, first) if before == 0 else slice(end, end)
    changed = np.flatnonzero(direction[first:end] != before)
    if before == 0 or (changed.size == 0 and before == after):
        return slice(first, end)
    still = first + (int(changed[0]) if changed.size else end - first)
    other = np.flatnonzero(direction[still:end] != after)
    return slice(still, still + int(other[-1]) + 1 if other.size else still)


def without_delays(candidates: Sequence[Candidate], columns: frozenset[str]) -> list[Candidate]:
    """Return candidates without delays of some columns."""
    return [each.without(columns) if isinstance(each, SensorDelay) else each for each in candidates]
