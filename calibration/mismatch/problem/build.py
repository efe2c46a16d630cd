"""Building a problem: check the recording, correct its inputs, simulate it, and leave outliers out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.calibration.mismatch.problem.covariates import covariates_of
from regolithd.calibration.mismatch.problem.errors_in_variables import expected_inputs
from regolithd.calibration.mismatch.problem.predictor import complete_inputs
from regolithd.calibration.mismatch.problem.problem import Problem
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]

MAD_TO_STD = 1.4826
"""Standard deviation of a normal density over its median absolute deviation."""


def build_problem(
    recording: Recording,
    simulation: Predictor,
    values: Mapping[str, float] | None = None,
    *,
    thresholds: Thresholds = THRESHOLDS,
) -> Problem:
    """Simulate the recording, with `values` for the parameters or as the simulation states them.

    Raises
    ------
    RecordingError
        When the predicted channel or an input is missing, or too little can be compared.
    """
    prepared = _prepared(recording, simulation)
    chosen = dict(values or {name: prior.value for name, prior in simulation.parameters.items()})
    inputs = complete_inputs(prepared)
    prediction = simulation.predict(inputs, {**simulation.variants(), **chosen})
    measured = prepared.channel(simulation.channel)
    mask = np.isfinite(prediction) & np.isfinite(measured)
    mask &= ~outliers(np.where(mask, measured - prediction, np.nan), thresholds.outlier_deviations)
    if mask.sum() < thresholds.fewest_readings:
        raise RecordingError(
            f"only {mask.sum()} values of {simulation.channel} can be compared; "
            f"at least {thresholds.fewest_readings} are needed"
        )
    return Problem(
        recording=prepared,
        simulation=simulation,
        values=chosen,
        measured=measured,
        prediction=prediction,
        mask=mask,
        covariates=covariates_of(prepared, simulation, inputs, prediction),
        side=simulation.side(recording.wheels),
        row=simulation.row(recording.wheels),
        thresholds=thresholds,
    )


def _prepared(recording: Recording, simulation: Predictor) -> Recording:
    """Return the recording with derived channels, and inputs replaced by their conditional expectation."""
    derived = simulation.prepare(recording)
    needed = (simulation.channel, *simulation.inputs)
    if missing := [name for name in needed if not np.isfinite(derived.channel(name)).any()]:
        raise RecordingError(f"the simulation needs {', '.join(missing)}, which the recording does not have")
    return expected_inputs(derived, simulation.sensors)


def outliers(residual: Array, deviations: float) -> NDArray[np.bool_]:
    """Return where a residual is so many standard deviations from its median, estimated robustly."""
    if not np.isfinite(residual).any():
        return np.zeros(residual.shape, np.bool_)
    middle = float(np.nanmedian(residual))
    deviation = MAD_TO_STD * float(np.nanmedian(np.abs(residual - middle)))
    return (np.abs(residual - middle) > deviations * deviation) & (deviation > 0)
