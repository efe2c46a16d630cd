"""Batches of groups: each group's gain is that of the group by itself."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.regression.screening.batch import Batch, Left
from regolithd.calibration.mismatch.regression.screening.schur import (
    delta_chi2_of_each,
    delta_chi2_together,
    schur_complement,
    schur_diagonal,
)

WHEELS, FITTED, COLUMNS, READINGS = 3, 2, 9, 40
LEAST = 1e-3


@pytest.mark.parametrize("size", [1, 3])
def test_a_group_gains_in_a_batch_what_it_gains_alone(size: int) -> None:
    """Wheels summed, signs kept: the same Δχ² as of the group by itself, on the set of wheels that is asked for."""
    generator = np.random.default_rng(3)
    values = generator.normal(size=(WHEELS, FITTED + COLUMNS, READINGS))
    values[:, FITTED + 5] = values[:, 0]
    residual = generator.normal(size=(WHEELS, READINGS))
    gram = np.einsum("wct,wdt->wcd", values, values)
    on, at = [0, 2], np.arange(COLUMNS).reshape(-1, size) + FITTED
    signs = generator.integers(-1, 2, at.shape).astype(np.float64)
    signs[0] = 0
    total, moment = gram[on].sum(axis=0), np.einsum("wct,wt->c", values[on], residual[on])
    inverse, cross = np.linalg.inv(total[:FITTED, :FITTED]), total[:FITTED]
    own = np.stack([gram[:, group[:, None], group] for group in at], axis=1)
    batch = Batch(np.arange(len(at)), at, signs, own)
    member = np.zeros((2, WHEELS))
    member[1, on] = 1.0
    less = np.stack((np.zeros(FITTED + COLUMNS), moment - moment[:FITTED] @ inverse @ cross))
    crosses = np.stack((gram[1, :FITTED], cross))
    left = Left(member, less, crosses, inverse @ crosses, np.stack((np.ones(FITTED + COLUMNS), np.diag(total))))
    asked = np.array([place for place in range(len(at)) if place != 1])
    found = batch.gains(left, np.ones(len(asked), np.int64), asked, LEAST)
    for gain, group, of_group in zip(found, at[asked], signs[asked], strict=True):
        if size == 1:
            outside = schur_diagonal(np.diag(total)[group], cross[:, group], inverse)
            alone = delta_chi2_of_each(less[1, group], outside, np.diag(total)[group], of_group, LEAST)[0]
        else:
            own_sums = total[np.ix_(group, group)]
            outside = schur_complement(own_sums, cross[:, group], inverse)
            alone = delta_chi2_together(less[1, group], outside, np.max(np.diag(own_sums)), of_group.tolist(), LEAST)
        assert gain == pytest.approx(float(alone), rel=1e-9, abs=1e-9)
    assert np.any(found > 0)
