"""What comes and goes along the motion is unexplained."""

from __future__ import annotations

import numpy as np
import pytest
from linear_machine import AXES, CANDIDATES, INSTANTS, equations_of, problem_of, table

from regolithd.calibration.mismatch.inference.intermittent import is_skewed, skewness_of, unexplained_if_intermittent
from regolithd.calibration.mismatch.inference.probability import decided_by_evidence
from regolithd.calibration.mismatch.regression.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.selection.decision import Decision, decide


def decided(added: np.ndarray | float) -> Decision:
    """Return what is decided of a recording with this drag along the motion, shape (time, axis)."""
    recorded = table(drag=added)
    equations = equations_of(problem_of(recorded))
    return decide(equations.over(with_smooth_terms(equations.design)), CANDIDATES)


def in_spells(size: float) -> np.ndarray:
    """Return a drag of the second axis that acts for 2.5 s now and then, a fifth of the time."""
    acting = np.random.default_rng(3).random(INSTANTS // 5) < 0.2
    spells = np.zeros((INSTANTS, AXES))
    spells[:, 1] = size * np.repeat(acting, 5)
    return spells


def test_a_drag_in_spells_is_unexplained_on_its_axis() -> None:
    """It is told over time, and no constant friction has its mean."""
    decision = unexplained_if_intermittent(decided(in_spells(0.8)))
    assert [(term.name, term.wheels) for term in decision.unnamed] == [("time", (1,))]
    assert not decision.named.terms
    assert not decided_by_evidence(decision)


def test_the_misfit_of_a_large_effects_law_is_no_finding() -> None:
    """Spells that are small against a drag which was named on both axes."""
    decision = decided(in_spells(0.8) + 5.0)
    assert {term.name for term in decision.named.terms} == {"drag"}
    assert unexplained_if_intermittent(decision) is decision


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_three_long_spells_are_unexplained_whatever_their_sign(sign: float) -> None:
    """They are twice the noise of a reading, and far above that of a mean over their length."""
    spells = np.zeros((INSTANTS, AXES))
    for begin in (120, 390, 610):
        spells[begin : begin + 20, 0] = 0.5 * sign
    decision = unexplained_if_intermittent(decided(spells))
    assert [(term.name, term.wheels) for term in decision.unnamed] == [("time", (0,))]


def test_slow_noise_is_not_intermittent() -> None:
    """Noise with a memory of a hundredth of the recording wanders to both sides."""
    skewed = 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        slow = np.convolve(random.normal(size=4000 + 400), np.exp(-np.arange(401) / 40), "valid")
        skewed += is_skewed(slow + random.normal(size=4000), np.zeros(4000))
    assert skewed == 0


@pytest.mark.parametrize("drag", [0.0, 0.3])
def test_noise_beside_what_was_found_is_not_intermittent(drag: float) -> None:
    """With and without a drag that has a name."""
    decision = decided(drag)
    assert unexplained_if_intermittent(decision) is decision


def test_single_readings_that_are_off_are_no_finding() -> None:
    """A sensor's faults of one reading each are left to the limits of outliers."""
    spikes = np.zeros((INSTANTS, AXES))
    spikes[10::40, 1] = 2.0
    decision = decided(spikes)
    assert unexplained_if_intermittent(decision) is decision


def test_the_standard_error_is_that_of_autocorrelated_noise() -> None:
    """Over many draws the skewness spreads as its standard error says."""
    random = np.random.default_rng(1)
    found = []
    for _ in range(200):
        noise = np.convolve(random.normal(size=2000), 0.8 ** np.arange(20))[:2000]
        found.append(skewness_of(noise))
    skewness, errors = np.array(found).T
    assert np.std(skewness) == pytest.approx(errors.mean(), rel=0.15)
    assert skewness_of(np.zeros(50)) == (0.0, float("inf"))
