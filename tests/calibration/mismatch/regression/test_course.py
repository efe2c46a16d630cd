"""The readings of some wheels as one course: the same numbers as in the design matrix, in another order."""

from __future__ import annotations

import numpy as np
import pytest
from linear_machine import AXES, INSTANTS, design_of, problem_of, table

from regolithd.calibration.mismatch.regression.course import course_of
from regolithd.calibration.mismatch.signal.whitening import NOT_WHITENED, Whitening

COLUMNS = np.random.default_rng(0).normal(size=(2, INSTANTS, AXES))


@pytest.mark.parametrize("whitening", [NOT_WHITENED, Whitening(np.array([0.5, 0.2]), np.array([1.1, 1.05]))])
@pytest.mark.parametrize("folds", [None, (0, 2)])
def test_a_column_is_whitened_as_in_the_design_matrix(whitening: Whitening, folds: tuple[int, ...] | None) -> None:
    """On one wheel and on all, on all folds and on some; what is not compared is in neither."""
    measured = table(drag=0.3)
    measured["reading_V"][40] = 1e3
    design = design_of(problem_of(measured))
    if whitening is not NOT_WHITENED:
        design = design.whitened_by(whitening)
    extended, places = design.extended(list(COLUMNS))
    columns = extended.columns(places) * extended.scale[list(places), None, None]
    folds = tuple(range(design.folds)) if folds is None else folds
    instants = np.concatenate([np.arange(design.cuts[fold], design.cuts[fold + 1]) for fold in folds])
    for wheels in ((1,), tuple(range(AXES))):
        course = course_of(extended, wheels, folds)
        known = design.problem.mask.T[:, design.order][list(wheels)]
        found = np.zeros((len(columns), len(wheels) * INSTANTS))
        found[:, course.placed] = course.whitened(COLUMNS)
        of_folds = found.reshape(len(columns), len(wheels), INSTANTS)[..., instants]
        np.testing.assert_allclose(of_folds, columns[:, list(wheels)][..., instants], atol=1e-4)
        on_wheels = columns[:, list(wheels)]
        flat = on_wheels.reshape(len(columns), -1)
        np.testing.assert_array_equal(course.ordered(on_wheels), flat[:, course.placed])
        assert len(course.placed) == known[:, instants].sum()
        assert course.wheel.tolist() == (course.placed // INSTANTS).tolist()
