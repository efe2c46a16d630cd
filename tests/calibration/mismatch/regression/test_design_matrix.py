"""The design matrix: scaled columns and their sums of products, which extensions leave alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from linear_machine import AXES, INSTANTS, design_of, problem_of, table

from regolithd.calibration.mismatch.regression.products import sums
from regolithd.calibration.mismatch.signal.noise_models.whitening import NOT_WHITENED, Whitening

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix

RNG = np.random.default_rng(0)
COLUMNS = [RNG.normal(size=(INSTANTS, AXES)) * scale for scale in (1.0, 5.0, 0.1)]


def gram_of(design: DesignMatrix) -> np.ndarray:
    """Return sums of products of all columns, shape (fold, wheel, column, column)."""
    return design.products(range(design.size), range(design.size))


@pytest.fixture(scope="module")
def empty() -> DesignMatrix:
    """Return a design matrix without columns, of a recording with an outlier."""
    columns = table(drag=0.3)
    columns["reading_V"][40] = 1e3
    return design_of(problem_of(columns))


def test_sums_of_products_are_those_of_the_scaled_columns(empty: DesignMatrix) -> None:
    """For each fold and wheel, outside the mask nothing."""
    design, places = empty.extended(COLUMNS)
    assert places == (0, 1, 2)
    mask, order = design.problem.mask, design.order
    assert not mask.all()
    scaled = np.stack([np.where(mask, c, 0) for c in COLUMNS]) / design.scale[:, None, None]
    np.testing.assert_allclose(np.sqrt((scaled**2).sum(axis=(1, 2)) / mask.sum()), 1)
    residual = np.where(mask, design.problem.measured - 2.0, 0)
    for fold, (a, b) in enumerate(zip(design.cuts[:-1], design.cuts[1:], strict=True)):
        for wheel in range(AXES):
            here = scaled[:, order[a:b], wheel]
            np.testing.assert_allclose(gram_of(design)[fold, wheel], here @ here.T, rtol=1e-4, atol=1e-3)
            np.testing.assert_allclose(design.moment[fold, wheel], here @ residual[order[a:b], wheel], atol=1e-2)
            assert design.energy[fold, wheel] == pytest.approx(np.sum(residual[order[a:b], wheel] ** 2), rel=1e-4)
            assert design.counts[fold, wheel] == mask[order[a:b], wheel].sum()


def test_columns_added_one_by_one_are_the_same_as_at_once(empty: DesignMatrix) -> None:
    """Products between old and new columns are made when the new ones come."""
    at_once, _ = empty.extended(COLUMNS)
    one_by_one = empty
    for column in COLUMNS:
        one_by_one, _ = one_by_one.extended([column])
    np.testing.assert_allclose(gram_of(one_by_one), gram_of(at_once), atol=1e-3)
    np.testing.assert_allclose(one_by_one.moment, at_once.moment, atol=1e-4)
    np.testing.assert_array_equal(one_by_one.columns(range(3)), at_once.columns(range(3)))


def test_extending_leaves_the_first_as_it_was(empty: DesignMatrix) -> None:
    """Two different extensions of one design matrix do not see each other's columns."""
    base, _ = empty.extended(COLUMNS[:1])
    before = gram_of(base).copy()
    one, (place,) = base.extended(COLUMNS[1:2])
    other, (same_place,) = base.extended(COLUMNS[2:])
    assert place == same_place == 1
    assert base.size == 1
    np.testing.assert_array_equal(gram_of(base), before)
    assert np.mean(one.columns([1]) != other.columns([1])) > 0.99
    np.testing.assert_allclose(gram_of(one.extended([])[0]), gram_of(one))
    straight, _ = empty.extended([COLUMNS[0], COLUMNS[1]])
    np.testing.assert_allclose(gram_of(one), gram_of(straight), atol=1e-3)
    np.testing.assert_allclose(one.moment, straight.moment, atol=1e-4)


@pytest.mark.parametrize("whitened", [False, True])
def test_products_of_later_columns_are_those_of_all_at_once(
    empty: DesignMatrix, monkeypatch: pytest.MonkeyPatch, *, whitened: bool
) -> None:
    """Also where room for them was made several times, and where only some were asked for before."""
    monkeypatch.setattr(sums, "MANY", 3)
    monkeypatch.setattr(sums, "ROOM", 2)
    many = [np.roll(COLUMNS[0], k, axis=0) for k in range(12)]
    design, _ = design_of(empty.problem).extended(many[:3])
    if whitened:
        empty = design_of(empty.problem).whitened_by(Whitening(np.array([0.5]), np.array([1.1])))
        design = design.whitened_by(empty.whitening)
    before = gram_of(design).copy()
    for k in range(3, 11, 2):
        design, places = design.extended(many[k : k + 2])
        assert places == (k, k + 1)
        design.products([0, k], [k + 1, 1])
    design, _ = design.extended(many[11:])
    gram = gram_of(design)
    np.testing.assert_allclose(gram[:, :, :3, :3], before, atol=1e-4)
    np.testing.assert_allclose(gram, np.swapaxes(gram, 2, 3), atol=1e-3)
    at_once, _ = empty.extended(many)
    np.testing.assert_allclose(gram, gram_of(at_once), atol=1e-3)
    np.testing.assert_allclose(design.moment, at_once.moment, atol=1e-3)
    own = np.diagonal(gram_of(at_once), axis1=2, axis2=3)
    np.testing.assert_allclose(design.energies(range(12)), own, atol=1e-3)
    np.testing.assert_allclose(design.own_products([2, 7], [0, 3]), at_once.own_products([2, 7], [0, 3]), atol=1e-3)


def test_columns_that_begin_later_have_the_same_products(empty: DesignMatrix, monkeypatch: pytest.MonkeyPatch) -> None:
    """In short pieces too, and after they were whitened: they are left out only where they are 0."""
    for name, value in {"MANY": 1, "LONGEST_PIECE": 7, "LONGEST_PART": 60}.items():
        monkeypatch.setattr(sums, name, value)
    later = np.arange(INSTANTS)[:, None] >= INSTANTS // 2
    design, _ = empty.extended([np.where(later, COLUMNS[0], 0.0), COLUMNS[1], np.where(later, COLUMNS[2], 0.0)])
    for whitening in (NOT_WHITENED, Whitening(np.array([0.5]), np.array([1.1]))):
        each = design.whitened_by(whitening)
        columns = each.columns(range(3)).astype(np.float64)
        for fold, (a, b) in enumerate(zip(each.cuts[:-1], each.cuts[1:], strict=True)):
            explicit = np.einsum("cwt,dwt->wcd", columns[..., a:b], columns[..., a:b])
            np.testing.assert_allclose(gram_of(each)[fold], explicit, rtol=1e-4, atol=1e-3)
            moment = np.einsum("cwt,wt->wc", columns[..., a:b], each.residual[:, a:b])
            np.testing.assert_allclose(each.moment[fold], moment, rtol=1e-4, atol=1e-3)


def test_sums_that_were_forgotten_are_summed_again(empty: DesignMatrix) -> None:
    """Under another whitening the first sums need no memory, and are there when they are asked for."""
    design, _ = empty.extended(COLUMNS)
    before = gram_of(design).copy()
    design.whitened_by(Whitening(np.array([0.5]), np.array([1.1])))
    np.testing.assert_allclose(gram_of(design), before, atol=1e-3)


def test_readings_are_whitened_as_columns_are(empty: DesignMatrix) -> None:
    """Straight from where they were computed, and whatever they are where nothing is compared."""
    unknown = np.where(empty.problem.mask, COLUMNS[0], np.nan)
    for design in (empty, empty.whitened_by(Whitening(np.array([0.5]), np.array([1.1])))):
        kept = np.where(empty.problem.mask, COLUMNS[0], 0.0)
        expected = design.whitened(design.in_folds(kept).astype(np.float32))
        for wheels in ([0, 1], [1]):
            course = design.course_of(wheels)
            np.testing.assert_allclose(course.whitened(unknown[None])[0], course.arranged(expected), atol=1e-6)
            assert course.arranged(expected).size == empty.problem.mask[:, wheels].sum()


def test_the_order_of_time_is_restored(empty: DesignMatrix) -> None:
    """A column comes back as it was."""
    design, _ = empty.extended(COLUMNS[:1])
    restored = design.in_time(design.columns([0])[0]) * design.scale[0]
    np.testing.assert_allclose(restored, np.where(design.problem.mask, COLUMNS[0], 0), atol=1e-5)


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-42])
def test_a_column_of_zeros_keeps_the_scale_one(empty: DesignMatrix, size: float) -> None:
    """Nothing is divided by nothing, nor by what is nothing in single precision."""
    design, _ = empty.extended([np.full((INSTANTS, AXES), size)])
    assert design.scale[0] == 1
    assert not design.columns([0]).any()
