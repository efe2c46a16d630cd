"""What comes and goes is told from noise of any memory, and of changing size."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from noise_courses import NOISE, READINGS, RECORDINGS, in_spells, over_its_noise, partly, with_memory

from regolithd.calibration.mismatch.signal.intermittency.spells import switching_spells
from regolithd.calibration.mismatch.signal.intermittency.switching_mean import SwitchingMean, switching_mean

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.random import Generator
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def found_in(course: Array, peers: Sequence[Array] = ()) -> SwitchingMean | None:
    """Return the two levels of a course, if it has them."""
    return switching_mean(over_its_noise(course)[0], [over_its_noise(peer)[0] for peer in peers])


@pytest.mark.parametrize("noise", NOISE.values(), ids=NOISE)
def test_noise_hardly_ever_comes_and_goes(noise: Callable[[Generator], Array]) -> None:
    """White, with a memory, quantised, with single readings that are skewed, and where its size changes."""
    assert sum(bool(found_in(noise(np.random.default_rng(seed)))) for seed in range(RECORDINGS)) <= RECORDINGS / 20


@pytest.mark.parametrize("share", [0.1, 0.25])
def test_a_little_slow_noise_in_a_short_course_does_not_come_and_go(share: float) -> None:
    """Beside an autoregression of few coefficients alone, 6 of 40 and 1 had spells."""
    courses = [partly(np.random.default_rng(seed), 40, share)[:1100] for seed in range(RECORDINGS)]
    assert sum(bool(found_in(course)) for course in courses) <= RECORDINGS / 20


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("rms", "rate"), [(0.7, 0.7), (1.0, 0.9)])
def test_spells_are_seen_whichever_way_they_pull(rms: float, rate: float, sign: float) -> None:
    """A belt that rubs a dozen times, as strongly over all readings as this share of the noise."""
    seen = 0
    for seed in range(RECORDINGS):
        random = np.random.default_rng(seed)
        seen += bool(found_in(sign * in_spells(random, rms)[0] + partly(random, 9)))
    assert seen >= rate * RECORDINGS


def test_spells_for_half_of_the_time_are_seen() -> None:
    """Their skewness is 0: it is the two levels that show them."""
    seen = 0
    for seed in range(RECORDINGS):
        random = np.random.default_rng(seed)
        acting = np.repeat(random.random(READINGS // 200) < 0.5, 200)
        seen += bool(found_in(1.3 * acting + partly(random, 9)))
    assert seen >= 0.9 * RECORDINGS


def test_peers_show_that_one_axis_has_more_than_noise() -> None:
    """Seven spells on one of six axes, of 1.8 times the noise of a reading: too weak for that axis alone."""
    alone = beside = sound = 0
    for seed in range(RECORDINGS):
        random = np.random.default_rng(seed)
        peers = [partly(random, 25, 0.4) for _ in range(5)]
        spells = np.zeros(READINGS)
        for begin in np.linspace(200, READINGS - 400, 7).astype(int):
            spells[begin : begin + int(random.uniform(100, 250))] = 1.8
        own = partly(random, 25, 0.4)
        alone += bool(found_in(own + spells))
        beside += bool(found_in(own + spells, peers))
        sound += bool(found_in(own, peers))
    assert beside >= 0.6 * RECORDINGS
    assert beside > 1.5 * alone
    assert sound <= RECORDINGS / 20


def test_an_axis_with_more_slow_noise_than_its_peers_has_no_spells() -> None:
    """Twice as large as theirs: what is unlike its peers must have two levels as well."""
    found = 0
    for seed in range(RECORDINGS):
        random = np.random.default_rng(seed)
        peers = [partly(random, 25, 0.4) for _ in range(5)]
        found += bool(found_in(partly(random, 25, 0.4) + with_memory(random, 25), peers))
    assert found <= RECORDINGS / 20


def test_spells_are_located_and_measured() -> None:
    """From the first to the last, and their share of the power: in the median over recordings."""
    first, last, shares = [], [], []
    for seed in range(RECORDINGS):
        random = np.random.default_rng(seed)
        drag, acting = in_spells(random, 0.9)
        course = over_its_noise(drag + partly(random, 9))[0]
        if switching := switching_mean(course):
            spells, at = switching_spells(course, switching), np.flatnonzero(acting)
            first.append(spells.first - at[0])
            last.append(spells.last - at[-1])
            shares.append(spells.share)
    assert abs(np.median(first)) < READINGS / 40
    assert abs(np.median(last)) < READINGS / 40
    assert np.median(shares) == pytest.approx(0.9**2 / (1 + 0.9**2), abs=0.1)


def test_few_readings_and_readings_that_are_all_alike_show_nothing() -> None:
    """Nothing is computed of them."""
    assert switching_mean(np.zeros(4000)) is None
    assert switching_mean(np.random.default_rng(0).normal(size=30)) is None
