"""What comes and goes along the motion is unexplained."""

from __future__ import annotations

import numpy as np
import pytest
from linear_machine import AXES, CANDIDATES, INSTANTS, NOISE, STEP_S, equations_of, problem_of, table

from regolithd.calibration.mismatch.inference.other_answers.probability import decided_by_evidence
from regolithd.calibration.mismatch.inference.unexplained.intermittent import unexplained_if_intermittent
from regolithd.calibration.mismatch.regression.groups.smooth_groups import PERIODIC, with_smooth_terms
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
    (spells,) = decision.intermittent
    assert spells.term is decision.unnamed[0]
    assert (spells.from_s, spells.to_s) == pytest.approx((120 * STEP_S, 630 * STEP_S), abs=8 * STEP_S)
    assert spells.share_of_residual == pytest.approx(0.075 * 0.5**2 / (0.075 * 0.5**2 + NOISE**2), abs=0.1)


def test_spells_that_recur_regularly_are_no_sine() -> None:
    """The strongest sine over time explains a part of them, and would tell a part of them."""
    spells = np.zeros((INSTANTS, AXES))
    spells[np.arange(INSTANTS) % 100 < 15, 0] = 0.5
    decision = unexplained_if_intermittent(decided(spells))
    assert [term.group.coupling == PERIODIC for term in decision.unnamed] == [False]


def test_spells_of_each_axis_are_told_of_each() -> None:
    """At different times, either has a curve of its own."""
    spells = in_spells(0.8) + 1.2 * in_spells(0.8)[::-1, ::-1]
    decision = unexplained_if_intermittent(decided(spells))
    assert [(term.name, term.wheels) for term in decision.unnamed] == [("time", (0,)), ("time", (1,))]


def test_spells_on_both_axes_are_unexplained_on_both() -> None:
    """Too weak for one axis to show them, they are told of both."""
    acting = np.random.default_rng(4).random(INSTANTS // 5) < 0.15
    spells = np.repeat(0.35 * acting, 5)[:, None] * np.ones(AXES)
    decision = unexplained_if_intermittent(decided(spells))
    assert [(term.name, term.wheels) for term in decision.unnamed] == [("time", (0, 1))]


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
