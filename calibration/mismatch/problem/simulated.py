"""One run of the simulation over a recording whose inputs have blanks.

A blank input is "not measured": nothing is compared there. A simulation that integrates over time would carry the blank
on to the end of its run, so it gets a value between the readings, as the column says: on a straight line, or the last
one held. What still depends on the choice between these two after the blank is known no better than that, and is not
compared either. A simulation without a state depends on nothing but its instant, and loses the blanks alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.slow_channels import bridged, filled_between
from regolithd.calibration.mismatch.errors import RecordingError, SimulationError
from regolithd.calibration.mismatch.problem.delayed import beyond_the_end, shifted
from regolithd.calibration.mismatch.problem.inputs.between_readings import doubt_by_slower
from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import ExpectedInputs, smoothed_inputs
from regolithd.calibration.mismatch.problem.inputs.exact_covariates import given_exact_covariates
from regolithd.calibration.mismatch.problem.inputs.input_doubt import (
    InputDoubt,
    bias_of,
    input_doubt,
    total_doubt,
)
from regolithd.calibration.mismatch.problem.inputs.input_faults import without_input_faults
from regolithd.calibration.mismatch.problem.inputs.input_units import notes_on_units
from regolithd.calibration.mismatch.problem.inputs.shown_errors import notes_on_errors, shown_errors
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.problem.state.gaps import carried_over_gaps, inputs_otherwise_in_gaps
from regolithd.calibration.mismatch.signal.robust import robust_std
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor
    from regolithd.calibration.mismatch.problem.prior import SensorError
    from regolithd.calibration.mismatch.thresholds import Thresholds

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NUDGE = 1.01
"""Factor of an input that shows whether the speed changes with it."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """A recording as a simulation needs it, whatever its parameters are.

    Attributes
    ----------
    as_read: with derived channels, and inputs bridged where they are blank
    expected: the same with inputs replaced by their conditional expectation
    bridged_otherwise: the same with blanks bridged in another way; None where there are none
    blanks: where each input was not measured
    undefined: where the simulation predicts nothing from the readings as they are, shape (time, wheel); None: nowhere
    doubt: of the prediction by the inputs' stated errors, and between the readings of slower ones; None: there is none
    between: by how much the prediction is uncertain since a slower column was read, by column, shape (time, wheel)
    otherwise_in_gaps: `expected` with the inputs as they may have been where rows are missing; None where no state of
        the simulation carries that on
    """

    as_read: Recording
    expected: Recording
    bridged_otherwise: Recording | None
    blanks: Mapping[str, Mask]
    undefined: Mask | None = None
    doubt: InputDoubt | None = None
    between: Mapping[str, Array] = field(default_factory=dict)
    otherwise_in_gaps: Recording | None = None

    @property
    def smoothed(self) -> dict[str, Array]:
        """Inputs that were replaced by their expectation, shape (time, wheel); empty where any was bridged as well."""
        if self.bridged_otherwise is not None:
            return {}
        read, expected = self.as_read.channels, self.expected.channels
        return {name: column for name, column in expected.items() if column is not read.get(name)}


@dataclass(frozen=True, eq=False)
class Simulated:
    """A prediction and what it was made from.

    Attributes
    ----------
    recording: with derived channels, and inputs replaced by their conditional expectation
    as_read: the same with the inputs' readings
    prediction: shape (time, wheel), NaN where the simulation says nothing
    blanks: where each input was not measured
    carried: where the prediction depends on an input that was not measured earlier
    changed: where it depends on how a slower column changed between its readings, by column
    after_gap: where it depends on what the inputs were while rows are missing
    """

    recording: Recording
    as_read: Recording
    prediction: Array
    blanks: Mapping[str, Mask]
    carried: Mask
    changed: Mapping[str, Mask]
    after_gap: Mask

    @property
    def known(self) -> Mask:
        """Where the prediction is made from what was measured."""
        unknown = np.any([self.carried, self.after_gap, *self.blanks.values(), *self.changed.values()], axis=0)
        return np.asarray(np.isfinite(self.prediction) & ~unknown)


def inputs_of(
    recording: Recording,
    simulation: Predictor,
    thresholds: Thresholds = THRESHOLDS,
    *,
    smoothed: Mapping[str, Array] | None = None,
) -> Inputs:
    """Return what the simulation is run on, without faults of a few readings.

    `smoothed` are inputs whose expectation was computed before (`Inputs.smoothed`).

    Raises
    ------
    RecordingError
        When the predicted channel or an input is missing.
    """
    stated = {name: prior.value for name, prior in simulation.parameters.items()}
    values = {**simulation.variants(), **stated}

    def predict(prepared: Recording, /, **moved: float) -> Array:
        return simulation.predict(complete_inputs(prepared), {**values, **moved})

    recording = without_input_faults(
        recording, simulation.channel, lambda faulty: predict(_prepared(faulty, simulation)[0]), thresholds
    )
    as_read, blanks = _prepared(recording, simulation)
    normal = _inputs_of_speed(as_read, simulation)

    def exact_beside(made: ExpectedInputs) -> list[str]:
        # Columns that the simulation derives may have the errors of those that they are derived from.
        return [name for name in recording.channels if name not in made.smoothers and name != simulation.channel]

    def expected_of(made: ExpectedInputs, errors: Mapping[str, SensorError]) -> Recording:
        return given_exact_covariates(as_read, made, errors, exact_beside(made))

    as_stated = cache(lambda: smoothed_inputs(as_read, simulation.sensors, normal))
    shown = shown_errors(as_read, simulation, predict, lambda: expected_of(as_stated(), simulation.sensors), normal)
    errors = {**simulation.sensors, **shown}
    if smoothed:
        made = ExpectedInputs(as_read.with_channels(**smoothed))
    else:
        made = smoothed_inputs(as_read, errors, normal) if shown else as_stated()
    expected = expected_of(made, errors)
    otherwise = None
    if blanks:
        other_way, _ = _prepared(recording, simulation, other_way=True)
        made_otherwise = smoothed_inputs(other_way, errors, normal)
        otherwise = given_exact_covariates(other_way, made_otherwise, errors, exact_beside(made))
    predicted = cache(lambda: predict(as_read))
    between = doubt_by_slower(recording, simulation, lambda filled: predict(_derived(filled, simulation)[0]), predicted)
    by_errors = input_doubt(as_read, expected, simulation, values, errors, made.smoothers)
    within = {name: each.within for name, each in between.items()}
    undefined = _undefined(predicted()) if expected is not as_read else None
    expected = expected.with_notes(*notes_on_errors(shown, simulation.sensors, as_read, simulation.channel))
    in_units = notes_on_units(
        recording,
        simulation,
        lambda other: predict(_prepared(other, simulation)[0]),
        predicted,
        lambda name, value: predict(as_read, **{name: value}),
    )
    expected = expected.with_notes(*in_units)
    carries = _carries_over_gaps(as_read, simulation, values, predicted)
    in_gaps = inputs_otherwise_in_gaps(expected, simulation.inputs) if carries else None
    doubt = total_doubt((by_errors, *(each.doubt for each in between.values())))
    return Inputs(as_read, expected, otherwise, blanks, undefined, doubt, within, in_gaps)


def _carries_over_gaps(
    recording: Recording, simulation: Predictor, values: Mapping[str, float], predicted: Callable[[], Array]
) -> bool:
    """Return whether the prediction after a gap depends on the inputs in it; False of what accepts no other inputs.

    `predicted` returns the prediction from the readings as they are.
    """
    other = inputs_otherwise_in_gaps(recording, simulation.inputs)
    if other is None:
        return False
    try:
        moved = simulation.predict(complete_inputs(other), values)
    except SimulationError:
        return False
    return bool(carried_over_gaps(recording, np.isfinite(predicted()) & (moved != predicted())).any())


def put_on_time(inputs: Inputs, late: Mapping[str, float], on: Mapping[str, tuple[int, ...]]) -> Inputs:
    """Return the inputs with some of their columns as they would have been recorded without their delay [s].

    What they were at the end of each run was not recorded any more. `on` has the wheels of those that are late on some.
    """

    def moved(recording: Recording) -> Recording:
        columns = {
            name: shifted(recording, recording.channels[name], delay, on.get(name, ())) for name, delay in late.items()
        }
        return recording.with_channels(**columns)

    others = (inputs.bridged_otherwise, inputs.otherwise_in_gaps)
    otherwise, in_gaps = (None if other is None else moved(other) for other in others)
    blanks = {
        name: shifted(inputs.expected, blank.astype(np.float64), late.get(name, 0.0), on.get(name, ())) > 0
        for name, blank in inputs.blanks.items()
    }
    for name, delay in late.items():
        blanks[name] = blanks.get(name, False) | beyond_the_end(inputs.expected, delay, on.get(name, ()))
    return replace(
        inputs,
        as_read=moved(inputs.as_read),
        expected=moved(inputs.expected),
        bridged_otherwise=otherwise,
        blanks=blanks,
        otherwise_in_gaps=in_gaps,
    )


def simulated(inputs: Inputs, simulation: Predictor, values: Mapping[str, float], thresholds: Thresholds) -> Simulated:
    """Run the simulation with these parameters; once more where an input has blanks, and where rows are missing."""
    prepared, other, blanks = inputs.expected, inputs.bridged_otherwise, inputs.blanks
    prediction = simulation.predict(complete_inputs(prepared), values) + bias_of(inputs.doubt)
    if inputs.undefined is not None:
        prediction = np.where(inputs.undefined, np.nan, prediction)
    carried, blank = np.zeros(prediction.shape, np.bool_), np.zeros(prediction.shape, np.bool_)
    for each in blanks.values():
        blank |= each
    residual = (inputs.as_read.channel(simulation.channel) - prediction)[~blank]
    residual = residual[np.isfinite(residual)]
    rounding, deviation = 1e-9 * float(np.max(np.abs(residual), initial=0.0)), robust_std(residual)

    def depends_on(other: Recording) -> Mask:
        apart = np.abs(simulation.predict(complete_inputs(other), values) + bias_of(inputs.doubt) - prediction)
        least = max(thresholds.carried_share * deviation, rounding)
        return np.asarray(np.isfinite(prediction) & ~blank & ~(apart <= least))

    if other is not None:
        carried = depends_on(other)
    after_gap = np.zeros(prediction.shape, np.bool_)
    if inputs.otherwise_in_gaps is not None:
        after_gap = carried_over_gaps(prepared, depends_on(inputs.otherwise_in_gaps)) & ~carried
    most = max(thresholds.between_share * deviation, rounding)
    changed = {name: ~blank & ~carried & ~after_gap & (within > most) for name, within in inputs.between.items()}
    return Simulated(prepared, inputs.as_read, prediction, blanks, carried, changed, after_gap)


def _undefined(predicted: Array) -> Mask | None:
    """Return where the simulation predicts nothing from the readings as they are, as at standstill; None: nowhere.

    A speed that is smoothed passes through zero more slowly and with less noise than the one that was read, and would
    be a motion, of either direction, where the simulation sees none.
    """
    undefined = ~np.isfinite(predicted)
    return undefined if undefined.any() else None


def _prepared(
    recording: Recording, simulation: Predictor, *, other_way: bool = False
) -> tuple[Recording, dict[str, Mask]]:
    """Return the recording with the inputs that the simulation needs, as read, and where they are bridged.

    Columns are bridged before the simulation derives others from them, and derived inputs after.
    """
    filled = filled_between(recording, simulation.channel, simulation.between_readings)
    return _derived(filled, simulation, other_way=other_way)


def _derived(filled: Recording, simulation: Predictor, *, other_way: bool = False) -> tuple[Recording, dict[str, Mask]]:
    """Return the same of a recording whose slower columns are filled in."""
    between = simulation.between_readings
    filled, recorded = bridged(filled, simulation.inputs, between, other_way=other_way)
    derived = simulation.prepare(filled)
    needed = (simulation.channel, *simulation.inputs)
    if missing := [name for name in needed if not np.isfinite(derived.channel(name)).any()]:
        raise RecordingError(f"the simulation needs {', '.join(missing)}, which the recording does not have")
    derived, more = bridged(derived, simulation.inputs, between, other_way=other_way)
    return derived, {**more, **recorded}


def _inputs_of_speed(recording: Recording, simulation: Predictor) -> frozenset[str]:
    """Return the inputs that `wheel_speed` changes with; none of a simulation that accepts no other inputs."""
    inputs = complete_inputs(recording)
    noisy = [name for name in {**simulation.sensors, **dict.fromkeys(simulation.inputs)} if name in inputs]
    speed = simulation.covariates(inputs).get("wheel_speed") if noisy else None
    if speed is None:
        return frozenset()
    try:
        changed = {name: simulation.covariates({**inputs, name: NUDGE * inputs[name]})["wheel_speed"] for name in noisy}
    except SimulationError:
        return frozenset()
    return frozenset(name for name in noisy if not np.array_equal(changed[name], speed, equal_nan=True))
