"""What comes and goes is told from noise that is as often above its mean as below."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from noise_courses import NOISE, READINGS, RECORDINGS, over_its_noise, partly
from scipy.stats import skewtest

from regolithd.calibration.mismatch.signal.intermittency.skewness import (
    normal_score,
    skewed_lengths,
    skewness_error,
    third_cumulant,
)
from regolithd.calibration.mismatch.signal.intermittency.spells import skewed_spells
from regolithd.calibration.mismatch.signal.intermittency.switching_mean import switching_mean

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.random import Generator
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def lengths_of(noise: Array) -> tuple[int, ...]:
    """Return the lengths at which one course of readings is skewed."""
    return skewed_lengths(*over_its_noise(noise))


@pytest.mark.parametrize("noise", NOISE.values(), ids=NOISE)
def test_symmetric_noise_hardly_ever_comes_and_goes(noise: Callable[[Generator], Array]) -> None:
    """White, with a memory, quantised, with single readings that are skewed, and where its size changes."""
    assert sum(bool(lengths_of(noise(np.random.default_rng(seed)))) for seed in range(RECORDINGS)) <= RECORDINGS / 20


def few_spells(random: Generator, count: int, height: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return a drag of this height in so many spells of 15 to 40 readings, and whether it acts."""
    acting = np.zeros(READINGS, bool)
    for begin in np.linspace(300, READINGS - 400, count).astype(int) + random.integers(-200, 200, count):
        acting[begin : begin + random.integers(15, 40)] = True
    return height * acting, acting


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("count", "height", "rate"), [(2, 3.0, 0.8), (3, 2.5, 0.8), (6, 2.0, 0.7)])
def test_few_large_spells_are_seen_whichever_way_they_pull(count: int, height: float, rate: float, sign: float) -> None:
    """A cable that catches, of so many times the noise of a reading; many small spells have two levels."""
    skewed = two_levels = 0
    for seed in range(RECORDINGS):
        random = np.random.default_rng(seed)
        noise = sign * few_spells(random, count, height)[0] + partly(random, 9)
        skewed += bool(lengths_of(noise))
        two_levels += bool(switching_mean(over_its_noise(noise)[0]))
    assert skewed >= rate * RECORDINGS
    assert two_levels < skewed


def test_spells_of_all_axes_are_seen_together() -> None:
    """Each axis has noise of its own and of another size, of which half is left in the sum of four."""
    alone = together = 0
    for seed in range(RECORDINGS):
        random = np.random.default_rng(seed)
        noise = np.stack([partly(random, 9) for _ in range(4)], axis=1)
        left = (few_spells(random, 3, 1.5)[0][:, None] + noise) * np.array([1.0, 2.0, 5.0, 0.1])
        together += bool(skewed_lengths(*over_its_noise(left)))
        alone += bool(lengths_of(left[:, 0]))
    assert together >= 0.9 * RECORDINGS
    assert alone < 0.3 * RECORDINGS


def test_what_named_effects_explain_is_no_spell() -> None:
    """A tenth of a large effect is the misfit of its law."""
    random = np.random.default_rng(2)
    drag, _ = few_spells(random, 3, 4.0)
    left = drag + partly(random, 9)
    assert skewed_lengths(left - left.mean(), 0 * left)
    assert not skewed_lengths(left - left.mean(), 10 * drag)


def test_spells_are_located_and_measured() -> None:
    """From the first to the last, and their share of the power, most of it: in the median over recordings."""
    first, last, shares, power = [], [], [], []
    for seed in range(RECORDINGS):
        random = np.random.default_rng(seed)
        drag, acting = few_spells(random, 4, 3.0)
        left = drag + partly(random, 9)
        if lengths := lengths_of(left):
            spells, at = skewed_spells(left - left.mean(), lengths), np.flatnonzero(acting)
            first.append(spells.first - at[0])
            last.append(spells.last - at[-1])
            shares.append(spells.share)
            power.append(np.var(drag) / (1 + np.var(drag)))
    assert len(shares) >= 0.9 * RECORDINGS
    assert abs(np.median(first)) < READINGS / 40
    assert abs(np.median(last)) < READINGS / 40
    assert np.median(shares) == pytest.approx(np.median(power), abs=0.1)


def test_without_any_reading_above_the_mirrored_lowest_the_highest_mean_is_the_spell() -> None:
    """Means that are hardly skewed have a place as well."""
    course = np.array([-1.0, -0.5, -0.5, 0.0, 0.0, 0.2, 1.0])
    assert (skewed_spells(course, (1,)).first, skewed_spells(course, (1,)).last) == (6, 6)


def test_the_standard_error_is_that_of_autocorrelated_noise() -> None:
    """Over many draws the skewness spreads as its standard error says."""
    random = np.random.default_rng(1)
    found = []
    for _ in range(200):
        noise = np.convolve(random.normal(size=2000), 0.8 ** np.arange(20))[:2000]
        found.append((third_cumulant(noise) / np.std(noise) ** 3, skewness_error(noise)))
    skewness, errors = np.array(found).T
    assert np.std(skewness) == pytest.approx(errors.mean(), rel=0.15)
    assert skewness_error(np.zeros(50)) == float("inf")


@pytest.mark.parametrize("readings", [20, 100, 1000])
def test_the_normal_score_of_skewness_is_that_of_scipy(readings: int) -> None:
    """SciPy has the test of D'Agostino (1970) for independent readings."""
    values = np.random.default_rng(readings).gamma(4.0, size=readings)
    skewness = third_cumulant(values) / np.std(values) ** 3
    assert normal_score(skewness, readings) == pytest.approx(skewtest(values).statistic)
