"""What is not compared: blanks and faults of a few readings are left out, counted and told with a reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.covariates import FOLLOW_SPEED
from regolithd.calibration.mismatch.problem.problem import LeftOut
from regolithd.calibration.mismatch.problem.words import word_for

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.problem.readings.outliers import FaultyReadings
    from regolithd.calibration.mismatch.problem.simulated import Simulated
    from regolithd.calibration.mismatch.thresholds import Thresholds

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def blanks_of(
    covariates: Mapping[str, Array], undefined_at_times: frozenset[str], compared: Mask, thresholds: Thresholds
) -> tuple[dict[str, Array], dict[str, Mask]]:
    """Return the covariates that are known well enough, and where each of them is blank.

    A covariate that is never known at a wheel says nothing there, and costs no reading. One that is known nowhere, or
    is blank too often, is left out as a whole, rather than the readings; with a speed, what follows from it.
    """
    kept, blanks = {}, {}
    for name, values in covariates.items():
        if not np.isfinite(values[compared]).any():
            continue
        blank = compared & ~np.isfinite(values)
        partly = blank & (compared & np.isfinite(values)).any(axis=0)
        if name in undefined_at_times or not partly.any():
            kept[name] = values
        elif partly.sum() <= (1 - thresholds.least_known_share) * compared[:, partly.any(axis=0)].sum():
            kept[name], blanks[name] = values, partly
    if "wheel_speed" in covariates and "wheel_speed" not in kept:
        for name in FOLLOW_SPEED:
            kept.pop(name, None)
            blanks.pop(name, None)
    return kept, blanks


def left_out(
    channel: str,
    measured: Array,
    run: Simulated,
    faults: FaultyReadings,
    blanks: Mapping[str, Mask],
    labels: Mapping[str, str],
) -> tuple[LeftOut, ...]:
    """Return what was measured and is not compared, each with its reason; `blanks` are those of covariates."""
    silent, known = ~np.isfinite(run.prediction), np.isfinite(measured)
    reasons = [
        (known & silent, "the simulation predicts nothing there"),
        *((known & ~silent & blank, f"{name} was not measured there") for name, blank in run.blanks.items()),
        (known & run.after_gap, "the prediction depends on what the inputs were in a gap of the recording"),
        (known & run.carried, f"the prediction depends on {', '.join(run.blanks)} where it was not measured"),
        *(
            (known & changed, f"{name}, which is measured less often, changed between its readings")
            for name, changed in run.changed.items()
        ),
        (faults.isolated, "single, isolated readings far outside all others"),
        (faults.codes, "a few in a row that are far out of the range of all others, as codes for faults are"),
        (faults.limited, "reading and prediction are at a limit that both have, or near to it"),
        (
            faults.saturated,
            "at the end of the sensor's range, where the furthest readings are all the same, or predicted near it",
        ),
        (faults.stuck, "the sensor is stuck: exactly the same reading again and again, while the prediction changes"),
        *((blank, f"{word_for(name, labels)} was not measured there") for name, blank in blanks.items()),
    ]
    return tuple(LeftOut(channel, int(where.sum()), reason) for where, reason in reasons if where.any())
