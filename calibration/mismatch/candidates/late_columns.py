"""When a predicted channel shows what acts on the machine: columns of candidates, late as the channel is late."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.problem.delayed import Restart, filtered, restart_of, shifted, smoothed
from regolithd.calibration.mismatch.problem.readings.limits import at_limit
from regolithd.calibration.mismatch.problem.tangents.fitted_variant import over_fitted_value

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Shape
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.problem import Problem

SENSOR_DELAY = "sensor-delay"
"""The name of the effect that makes a column late."""
DEAD_TIME = "secant_s"
"""The shape parameter that holds the dead time of the predicted channel."""
OF_INPUT = "input_secant_s"
"""The shape parameter that holds the dead time of an input."""
OF_CHANNEL: Mapping[str, Callable[[Recording, Array, float, Restart | None], Array]] = {
    DEAD_TIME: lambda recording, values, delay, _: shifted(recording, values, -delay),
    "filter_s": filtered,
    "smoothing_s": smoothed,
}
"""What delays the predicted channel, by the shape parameter that holds the delay: dead time, or a filter."""


KINDS = (*OF_CHANNEL, OF_INPUT)
"""The shape parameters that hold a delay, of which a shape has one."""


def columns_of(problem: Problem, candidate: Candidate, shape: Shape) -> Array:
    """Return a candidate's columns as the predicted channel shows them: not at a limit, and late where it is late."""
    columns = np.asarray(candidate.columns(over_fitted_value(problem, shape), shape), np.float64)
    if candidate.loads and (limited := at_limit(problem)).any():
        columns = np.where(limited, 0.0, columns)
    return late_with(problem, candidate, columns)


def late_with(problem: Problem, candidate: Candidate, columns: Array) -> Array:
    """Return columns (column, time, wheel) that act as a candidate does, as the predicted channel shows them."""
    if problem.late is None or not candidate.late_with_channel:
        return columns
    return np.asarray(as_shown(problem, list(columns)), np.float64).reshape(columns.shape)


def as_shown(problem: Problem, columns: Sequence[Array]) -> Sequence[Array]:
    """Return what acts on the machine, columns of shape (time, wheel), when the predicted channel shows it."""
    if problem.late is None or problem.late[1] == 0:
        return columns
    kind, delay = problem.late
    restart = None if kind == DEAD_TIME else restart_of(problem, delay)
    restart = restart and restart.of_a_change
    late = [np.nan_to_num(OF_CHANNEL[kind](problem.recording, bridged(column), delay, restart)) for column in columns]
    if not problem.late_on:
        return late
    on = np.isin(np.arange(problem.mask.shape[1]), problem.late_on)
    return [np.where(on, shifted, column) for shifted, column in zip(late, columns, strict=True)]


def bridged(values: Array) -> Array:
    """Return values (time, wheel) with straight lines across what is not known; as they are where nothing is known."""
    found, rows = np.array(values, np.float64), np.arange(len(values))
    for column in found.T:
        known = np.isfinite(column)
        if known.any() and not known.all():
            column[:] = np.interp(rows, rows[known], column[known])
    return found


def late_inputs(effects: Iterable[tuple[str, Shape]], inputs: Sequence[str]) -> dict[str, float]:
    """Return how late each of these inputs is by some effects, names and shapes [s]."""
    shapes = [shape for name, shape in effects if name == SENSOR_DELAY and OF_INPUT in shape]
    return {str(shape["late"]): float(shape[OF_INPUT]) for shape in shapes if shape["late"] in inputs}


def late_inputs_on(effects: Iterable[tuple[str, Shape, Sequence[int]]], count: int) -> dict[str, tuple[int, ...]]:
    """Return the wheels of inputs that some effects, names, shapes and wheels, make late on some of so many."""
    found = {str(shape["late"]): on_some(wheels, count) for name, shape, wheels in effects if OF_INPUT in shape}
    return {name: wheels for name, wheels in found.items() if wheels}


def lateness(effects: Iterable[tuple[str, Shape]], channel: str) -> tuple[str, float] | None:
    """Return how the first of some effects, names and shapes, makes a predicted channel late, and by how much [s].

    None where none does.
    """
    for name, shape in effects:
        if makes_late(name, shape, channel):
            return next(((kind, float(shape[kind])) for kind in OF_CHANNEL if kind in shape), None)
    return None


def makes_late(name: str, shape: Shape, channel: str) -> bool:
    """Return whether an effect makes a predicted channel late."""
    return name == SENSOR_DELAY and shape.get("late") == channel


def on_some(wheels: Iterable[int], count: int) -> tuple[int, ...]:
    """Return the wheels on which a channel is late, by their indices; empty where these are all."""
    found = tuple(sorted(set(wheels)))
    return found if len(found) < count else ()
