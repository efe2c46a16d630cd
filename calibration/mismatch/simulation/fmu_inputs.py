"""Inputs of an FMU between its communication points.

FMPy sets the inputs of a co-simulation at the beginning of each step, and those of a model exchange after a step of its
solver, which is up to a fiftieth of the whole run: short motions are skipped. Here the inputs are set at the instants
at which the FMU asks for them.

Between two readings an input is on a straight line, or it is held by whoever commands it. A recording does not say
which: the instant within a step whose inputs stand for the step is unknown, from its beginning (0: held) over its
middle (0.5: a straight line) to its end (1: held until the reading). It is a parameter that is fitted and not told.
"""

from __future__ import annotations

from bisect import bisect_left
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from regolithd.calibration.mismatch.problem.prior import Prior

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

INSTANT = "instant of inputs within a step"
ANY_INSTANT = Prior(0.5, 12**-0.5, told=False, bounds=(0.0, 1.0))
"""Mean and standard deviation of what is anywhere between 0 and 1."""
REAL = {"Real": "setReal", "Float64": "setFloat64", "Float32": "setFloat32"}
"""FMPy's setters of continuous variables, by type."""


def continuous(variable: Any) -> bool:  # noqa: ANN401  # FMPy's own type
    """Return whether a variable may change between events (FMI 2.0, 2.2.7: variability)."""
    return variable.type in REAL and variable.variability not in {"discrete", "tunable"}


def follow_inputs(fmu: Any, variables: Mapping[str, Any], signal: NDArray[Any], instant: float) -> None:  # noqa: ANN401  # FMPy has no types
    """Let an instance of an FMU have its continuous inputs at every instant that it computes.

    Parameters
    ----------
    fmu: a slave or a model, instantiated
    variables: of the model description, by name
    signal: `time` and a field for each input, one row for each reading
    instant: within a step, whose inputs stand for the step: 0 its beginning, 1 its end
    """
    real = [name for name in signal.dtype.names or () if name != "time" and variables[name].type in REAL]
    put = _setter(fmu, [variables[name] for name in real if continuous(variables[name])], signal)
    if hasattr(fmu, "doStep"):
        fmu.doStep = partial(_step, fmu.doStep, put, _setter(fmu, [variables[name] for name in real], signal), instant)
    else:
        _stop_at_readings(fmu, put, signal["time"], instant)


def _setter(fmu: Any, variables: Sequence[Any], signal: NDArray[Any]) -> Callable[[float], None]:  # noqa: ANN401
    """Return what sets inputs to their values at an instant, on a straight line between readings."""
    # Lists, since a number of an array takes Python ten times as long.
    times, last = signal["time"].tolist(), len(signal) - 1
    groups = []
    for kind, setter in REAL.items():
        if chosen := [each for each in variables if each.type == kind]:
            rows = np.stack([signal[each.name] for each in chosen], axis=1).tolist()
            groups.append((getattr(fmu, setter), [each.valueReference for each in chosen], rows))

    def put(time: float) -> None:
        after = min(max(bisect_left(times, time), 1), last)
        before = after - 1
        share = min(max((time - times[before]) / (times[after] - times[before]), 0.0), 1.0)
        for set_values, references, rows in groups:
            pairs = zip(rows[before], rows[after], strict=True)
            set_values(references, [(1 - share) * one + share * other for one, other in pairs])

    return put


def _step(
    step: Callable[..., Any],
    put: Callable[[float], None],
    put_all: Callable[[float], None],
    instant: float,
    currentCommunicationPoint: float,  # FMPy's names
    communicationStepSize: float,
    **options: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Advance a co-simulation by a step; afterwards its outputs have the inputs of the same instant."""
    put(currentCommunicationPoint + instant * communicationStepSize)
    told = step(
        currentCommunicationPoint=currentCommunicationPoint, communicationStepSize=communicationStepSize, **options
    )
    put_all(currentCommunicationPoint + communicationStepSize)
    return told


def _stop_at_readings(fmu: Any, put: Callable[[float], None], readings: Any, instant: float) -> None:  # noqa: ANN401
    """Give a model exchange its inputs at each instant of its solver, which begins anew at each reading.

    The solver's steps would otherwise grow while nothing changes, and pass what happens in between.
    """
    set_time, now = fmu.setTime, [float(readings[0])]
    shift = (instant - ANY_INSTANT.value) * float(np.median(np.diff(readings)))

    def set_both(time: float) -> Any:  # noqa: ANN401
        now[0] = time
        told = set_time(time)
        put(time + shift)
        return told

    def with_next_reading(update: Callable[[], tuple[Any, ...]]) -> tuple[Any, ...]:
        *told, planned, event = update()
        later = np.searchsorted(readings, now[0] + 1e-9 * abs(now[0]), side="right")
        if later == len(readings) or (planned and event <= readings[later]):
            return (*told, planned, event)
        return (*told, True, float(readings[later]))

    fmu.setTime = set_both
    name = "newDiscreteStates" if hasattr(fmu, "newDiscreteStates") else "updateDiscreteStates"
    setattr(fmu, name, partial(with_next_reading, getattr(fmu, name)))
