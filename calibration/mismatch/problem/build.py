"""Building a problem: check the recording, correct its inputs, simulate it, and leave outliers out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.calibration.mismatch.problem.covariates import covariates_of
from regolithd.calibration.mismatch.problem.inputs.between_readings import doubts_by_moved
from regolithd.calibration.mismatch.problem.inputs.input_doubt import bias_of, total_doubt, without_error_of_derivatives
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.problem.problem import Problem
from regolithd.calibration.mismatch.problem.readings.compared import blanks_of, left_out
from regolithd.calibration.mismatch.problem.readings.outliers import FaultyReadings, note_on_far_readings
from regolithd.calibration.mismatch.problem.readings.zero import note_on_zero, zero_is_arbitrary
from regolithd.calibration.mismatch.problem.simulated import Inputs, inputs_of, put_on_time, simulated
from regolithd.calibration.mismatch.problem.words import labels_of
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]

BEYOND_ALL = 1e9
"""Times the largest reading, beyond which a prediction is no value (a choice: no unit is wrong by more)."""
ANOTHER_UNIT = 30.0
"""Times what is predicted, or its reciprocal, from which a reading is likely to be in another unit (a choice: minutes,
degrees and all prefixes are further off, and a simulation that is worse is none)."""
SAME = 1e-9
"""One less the correlation of two columns, up to which they are one, in whatever unit: their digits."""


def build_problem(
    recording: Recording,
    simulation: Predictor,
    values: Mapping[str, float] | None = None,
    *,
    inputs: Inputs | None = None,
    late: Mapping[str, float] | None = None,
    late_on: Mapping[str, tuple[int, ...]] | None = None,
    thresholds: Thresholds = THRESHOLDS,
) -> Problem:
    """Simulate the recording, with `values` for the parameters or as the simulation states them.

    `inputs` are those of the recording, where they have been prepared for other values before; `late` are inputs that
    are put on time, and how late they were recorded [s]; `late_on` has the wheels of those that are late on some.

    Raises
    ------
    RecordingError
        When the predicted channel or an input is missing, or too little can be compared.
    """
    chosen = dict(values or {name: prior.value for name, prior in simulation.parameters.items()})
    inputs = inputs or inputs_of(recording, simulation, thresholds)
    all_values = {**simulation.variants(), **chosen}
    run = simulated(put_on_time(inputs, late, late_on or {}) if late else inputs, simulation, all_values, thresholds)
    as_recorded, doubt = None, inputs.doubt
    if late:

        def predict(others: Mapping[str, Array]) -> Array:
            return simulation.predict(others, all_values) + bias_of(inputs.doubt)

        doubt = total_doubt((doubt, *doubts_by_moved(run.recording, predict, run.prediction, late, late_on or {})))
        as_recorded = predict(complete_inputs(inputs.expected))
        as_recorded = np.where(np.isfinite(as_recorded), as_recorded, run.prediction)
    prepared, prediction = run.recording, run.prediction
    measured = run.as_read.channel(simulation.channel)  # as read, also where it is an input that is smoothed
    compared = run.known & np.isfinite(measured)
    _check_bounded(simulation, recording, prediction, measured)
    faults = FaultyReadings.of(measured, prediction, compared, recording.run, thresholds)
    as_read = None if run.as_read is prepared else complete_inputs(run.as_read)
    found, constants = covariates_of(
        prepared,
        simulation,
        complete_inputs(prepared),
        without_error_of_derivatives(prediction, inputs.doubt, prepared),
        as_read,
        arbitrary_zero=zero_is_arbitrary(simulation, measured),
    )
    found, notes = without_the_reading_itself(found, measured, simulation.channel)
    far = note_on_far_readings(simulation.channel, faults.compared, compared, thresholds)
    of_size = _note_on_size(simulation.channel, measured[compared], prediction[compared])
    prepared = prepared.with_notes(*notes, *note_on_zero(simulation, measured), *far, *of_size)
    covariates, blanks = blanks_of(found, simulation.undefined_at_times, compared, thresholds)
    mask = compared & ~faults.all
    for blank in blanks.values():
        mask &= ~blank
    predicted = {simulation.channel: np.abs(prediction)}
    labels = labels_of(simulation.covariate_labels, {**constants, **covariates}, prepared.channels, predicted)
    not_compared = left_out(simulation.channel, measured, run, faults, blanks, labels)
    if mask.sum() < thresholds.fewest_readings:
        reasons = "".join(f"; {each.readings} are not: {each.reason}" for each in not_compared)
        silent = np.isfinite(measured) & ~np.isfinite(prediction)
        cure = ""
        if 2 * silent.sum() > np.isfinite(measured).sum():
            cure = f"; `predict` returns NaN from {prepared.time_s[silent.any(axis=1)][0]:.6g} s on: look there first"
        raise RecordingError(
            f"only {mask.sum()} values of {simulation.channel} can be compared; "
            f"at least {thresholds.fewest_readings} are needed{reasons}{cure}"
        )
    return Problem(
        recording=prepared,
        simulation=simulation,
        values=chosen,
        measured=measured,
        prediction=prediction,
        mask=mask,
        covariates=covariates,
        constants=constants,
        labels=labels,
        side=simulation.side(recording.wheels),
        row=simulation.row(recording.wheels),
        left_out=not_compared,
        thresholds=thresholds,
        doubt=doubt,
        on_time=dict(late or {}),
        on_time_on=dict(late_on or {}),
        as_recorded=as_recorded,
        smoothed=inputs.smoothed,
    )


def _check_bounded(simulation: Predictor, recording: Recording, prediction: Array, measured: Array) -> None:
    """Raise an error where a prediction (time, wheel) is beyond all readings: a state has grown without bound."""
    most = float(np.nanmax(np.abs(measured), initial=0.0))
    instants = np.flatnonzero((np.abs(prediction) > BEYOND_ALL * most).any(axis=1)) if most > 0 else np.zeros(0)
    if instants.size:
        time_s, step_s = recording.time_s[instants[0]], recording.step_s
        raise RecordingError(
            f"the predicted {simulation.channel} grows without bound: at t = {time_s:g} s it is more than "
            f"{BEYOND_ALL:g} times the largest reading, {most:.4g}. The rows are {step_s:g} s apart: check that t_s is "
            "in seconds, and that a state of the simulation stands such steps"
        )


def _note_on_size(channel: str, measured: Array, prediction: Array) -> tuple[str, ...]:
    """Return a note where readings are of another size than the prediction, as in another unit."""
    read, predicted = (float(np.sqrt(np.mean(values**2))) if values.size else 0.0 for values in (measured, prediction))
    if not (read > 0 and predicted > 0) or 1 / ANOTHER_UNIT < read / predicted < ANOTHER_UNIT:
        return ()
    told = f"{channel} is {read / predicted:.3g} times what is predicted (root mean square): check its unit, and the "
    return (f"{told}inputs' units.",)


def without_the_reading_itself(
    covariates: Mapping[str, Array], measured: Array, channel: str
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return the covariates (time, wheel) but those that are the predicted column's own reading, and a note of each.

    A curve over a reading explains the noise of that reading.
    """
    own = [name for name, values in covariates.items() if _is_reading_of(values, measured)]
    notes = tuple(
        f"{name} is the reading of {channel} itself, whose noise it would explain; it is left out. Return what the "
        f"simulation predicts for it from `covariates`, or another sensor's reading."
        for name in own
    )
    return {name: values for name, values in covariates.items() if name not in own}, notes


def _is_reading_of(values: Array, measured: Array) -> bool:
    """Return whether two columns (time, wheel) are the same but for a unit."""
    known = np.isfinite(values) & np.isfinite(measured)
    if values.shape != measured.shape or known.sum() < 3:
        return False
    one, other = (each[known] - each[known].mean() for each in (values, measured))
    size = float(np.sqrt((one @ one) * (other @ other)))
    return size > 0 and abs(float(one @ other)) > (1 - SAME) * size
