"""The generalised likelihood ratio from sums of products is that of a least-squares fit to all rows."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch.online.scores import Place, Scores, Search, scores
from regolithd.calibration.mismatch.online.sums import Course, Interval, Suffixes, sums_of
from regolithd.calibration.mismatch.online.unnamed import Unnamed, lacks_fit, unnamed

Array = NDArray[np.float64]
WHEELS, INSTANTS, PARTS = 2, 30, 6
WEIGHTS = np.array([0.7, 1.9])
MEMBER = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
PRECISION = np.array([3.0])
LEVEL = 1e-3


def machine(signs: tuple[float, float] = (0.0, 0.0), smallest: float = 0.0) -> tuple[Search, list[Interval], Array]:
    """Return a search of two laws beside one tangent, random intervals, and all columns (column, time, wheel)."""
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(3, PARTS * INSTANTS, WHEELS))
    columns[2] += 0.5 * columns[1]
    residual = rng.normal(size=(PARTS * INSTANTS, WHEELS))
    residual[3 * INSTANTS :, 1] += 2.0 * columns[1, 3 * INSTANTS :, 1]
    parts = []
    for k in range(PARTS):
        here = slice(k * INSTANTS, (k + 1) * INSTANTS)
        mask = np.ones((INSTANTS, WHEELS), np.bool_)
        size = float(INSTANTS * WHEELS)
        parts.append(Interval(60.0 * k, 60.0 * k + 60, columns[:, here], residual[here], mask, size))
    everywhere = np.ones((3, 2), np.bool_)
    search = Search(PRECISION, MEMBER, everywhere, everywhere, np.array(signs), 1e-3, smallest)
    return search, parts, columns


def scored(search: Search, parts: list[Interval], beside: list[Place]) -> Scores:
    """Return the scores from sums."""
    course = Course(100)
    for part in parts:
        course.add(part.start_s, sums_of(part))
    return scores(course.suffixes(), WEIGHTS, search, beside)


def chi2(parts: list[Interval], columns: Array, places: list[Place]) -> float:
    """Return the penalised weighted sum of squares that the tangent and some places leave, by least squares."""
    residual = np.concatenate([part.residual for part in parts])
    made = [columns[0]]
    for place in places:
        since = (np.arange(len(residual)) >= place.onset_s / 60 * INSTANTS)[:, None]
        made.append(columns[1 + place.law] * since * MEMBER[place.wheels])
    weight = np.sqrt(np.broadcast_to(WEIGHTS, residual.shape)).ravel()
    matrix = np.stack([column.ravel() * weight for column in made], axis=1)
    prior = np.zeros((1, matrix.shape[1]))
    prior[0, 0] = np.sqrt(PRECISION[0])
    matrix, target = np.vstack((matrix, prior)), np.append(residual.ravel() * weight, 0.0)
    return float(np.sum((target - matrix @ np.linalg.lstsq(matrix, target, rcond=None)[0]) ** 2))


@pytest.mark.parametrize("beside", [[], [Place(0, 1, 180.0)], [Place(0, 1, 180.0), Place(1, 2, 60.0)]])
def test_the_statistic_is_the_fall_of_the_sum_of_squares(beside: list[Place]) -> None:
    """For both laws, every set of wheels and every onset, beside none, one and two changes."""
    search, parts, columns = machine()
    found = scored(search, parts, beside)
    without = chi2(parts, columns, beside)
    for law in range(2):
        for wheels in range(3):
            for segment in range(PARTS):
                place = Place(law, wheels, 60.0 * segment)
                if place not in beside:
                    expected = without - chi2(parts, columns, [*beside, place])
                    assert found.statistic[segment, wheels, law] == pytest.approx(expected, abs=1e-6)


def test_the_best_place_is_where_the_change_is() -> None:
    """Law, wheel and onset of the change that was added, with its size."""
    search, parts, _ = machine()
    found = scored(search, parts, [])
    assert found.best() == Place(0, 1, 180.0)
    assert found.size[found.at(found.best())] == pytest.approx(2.0, abs=0.3)


def test_a_place_beside_itself_scores_nothing() -> None:
    """What is fitted already has nothing to add."""
    search, parts, _ = machine()
    found = scored(search, parts, [Place(0, 1, 180.0)])
    assert found.statistic[3, 1, 0] == 0.0


def test_a_coefficient_of_the_wrong_sign_scores_nothing() -> None:
    """A drag that would have to push is none."""
    search, parts, _ = machine(signs=(-1.0, 0.0))
    assert scored(search, parts, []).statistic[3, 1, 0] == 0.0


def test_what_is_too_small_to_matter_scores_nothing() -> None:
    """Below the least share of the channel's mean magnitude, which is 1 here."""
    search, parts, _ = machine(smallest=3.0)
    assert scored(search, parts, []).statistic.max() == 0.0


def sums() -> Suffixes:
    """Return the sums of the random intervals."""
    course = Course(100)
    for part in machine()[1]:
        course.add(part.start_s, sums_of(part))
    return course.suffixes()


@pytest.mark.parametrize("beside", [[], [Place(0, 0, 120.0)]])
def test_the_statistic_is_that_of_all_columns(beside: list[Place]) -> None:
    """Both laws and the tangent on one wheel, from each onset, by least squares."""
    search, parts, columns = machine()
    found = unnamed(sums(), WEIGHTS, search, beside, 1, LEVEL)
    without = chi2(parts, columns, beside)
    for segment in range(1, len(parts)):
        onset_s = 60.0 * segment
        every = [Place(law, 1, onset_s) for law in (-1, 0, 1)]  # −1: the tangent, which is before the laws
        assert found.statistic[segment] == pytest.approx(without - chi2(parts, columns, [*beside, *every]), abs=1e-6)
        assert found.rank[segment] == 3
    assert found.onset_s() == 180.0
    assert len(PRECISION) == 1


def test_readings_are_left_out_of_the_sums() -> None:
    """Those of one wheel from a segment on, and no others."""
    whole = sums()
    less = whole.without([1], 180.0)
    np.testing.assert_array_equal(less.gram[:, 0], whole.gram[:, 0])
    np.testing.assert_allclose(less.gram[3:, 1], 0.0)
    np.testing.assert_allclose(less.moment[0, 1], whole.moment[0, 1] - whole.moment[3, 1])
    assert MEMBER[1, 1] == 1.0


@pytest.mark.parametrize(("together", "lacks"), [(110.0, False), (125.0, False), (150.0, True)])
def test_a_law_lacks_fit_beyond_chance_and_its_inexact_shape(together: float, lacks: bool) -> None:
    """Of a Δχ² of 100, with three further coefficients (16.3 by chance) and a tenth of it."""
    one = np.array([together])
    found = Unnamed(np.zeros(1), one, np.array([4]), one, np.ones(1))
    assert lacks_fit(100.0, found, 0, LEVEL, 0.1) is lacks
