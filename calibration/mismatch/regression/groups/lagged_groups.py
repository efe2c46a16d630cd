"""Lagged terms: what the simulation predicted before, and how the machine was accelerated before.

A reading that rings, or follows slowly, is the prediction behind a filter whose impulse response is not known (a
distributed lag; Almon, 1965). The response is piecewise linear between a few lags, and its columns are differences to
what is predicted now: a constant prediction is not filtered. What comes later is computed likewise, for the test that
nothing follows it (`selection/plausibility/causality.py`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import as_shown, bridged
from regolithd.calibration.mismatch.regression.group import Group
from regolithd.calibration.mismatch.regression.groups.smooth_groups import SINES
from regolithd.calibration.mismatch.regression.groups.state_groups import ON_STATE

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix

Array = NDArray[np.float64]
Index = NDArray[np.int64]

LAGGED_PREDICTION, LAGGED_ACCELERATION = "lagged_prediction", "lagged_acceleration"
LAGGED = frozenset({LAGGED_PREDICTION, LAGGED_ACCELERATION})
"""Covariates of lagged terms."""
FILTERED = "filtered"
"""Coupling of lagged terms."""
WITHOUT_CURVE = SINES | {FILTERED, ON_STATE}
"""Couplings of smooth terms that are no curve over their covariate."""
LAGS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32)
"""Lags between which the impulse response is linear, in readings (a choice: as many as the columns of a term that is
taken out before the noise is estimated; close enough for periods from six readings on, and as long as the noise's
autoregression needs for an octave more)."""
LEADS = (1, 2, 4, 8, 16, 32)
"""The same for what comes later (a choice: octaves, as it is asked for as a whole)."""


def with_lagged_terms(design: DesignMatrix) -> DesignMatrix:
    """Add the past of the prediction, and of the acceleration where there is one, as smooth terms."""
    problem = design.problem
    design = _with_lagged(design, LAGGED_PREDICTION, np.nan_to_num(bridged(problem.prediction)))
    if problem.has("wheel_acceleration"):
        design = _with_lagged(design, LAGGED_ACCELERATION, problem.known("wheel_acceleration"))
    return design


def _with_lagged(design: DesignMatrix, name: str, values: Array) -> DesignMatrix:
    """Add the past of a quantity (time, wheel) as one group, beside its future; nothing of one that does not change."""
    problem = design.problem
    if not np.diff(values, axis=0).any():
        return design
    columns = [*differences(problem.recording, values, LEADS, -1), *differences(problem.recording, values, LAGS, 1)]
    design, places = design.extended(as_shown(problem, columns))
    later, before = places[: len(LEADS)], places[len(LEADS) :]
    group = Group(
        name=name, columns=before, signs=(0,) * len(LAGS), sharing=("all", "one"), coupling=FILTERED, later=later
    )
    return design.with_groups((*design.groups, group))


def differences(recording: Recording, values: Array, lags: tuple[int, ...], way: int) -> list[Array]:
    """Return what impulse responses add to values (time, wheel), less the values now: one column for each lag.

    `way` is 1 for what was before, and -1 for what comes later. Each response is a hat over its lag, from the lag
    before it to the one after. Each run begins and ends at its outermost values; so does what is beside a gap.
    """
    first, last = _pieces(recording)
    rows = np.arange(len(values))
    hats = np.eye(len(lags))
    columns = [np.zeros(values.shape) for _ in lags]
    for lag in range(1, lags[-1] + 1):
        change = values[np.clip(rows - way * lag, first, last)] - values
        for place, hat in enumerate(hats):
            if share := float(np.interp(lag, lags, hat)):
                columns[place] += share * change
    return columns


def _pieces(recording: Recording) -> tuple[Index, Index]:
    """Return the first and last row of the piece without a gap that each row is in."""
    starts = np.concatenate(([0], 1 + np.flatnonzero(~recording.without_gap)))
    lengths = np.diff(np.append(starts, len(recording.run)))
    return np.repeat(starts, lengths), np.repeat(starts + lengths - 1, lengths)
