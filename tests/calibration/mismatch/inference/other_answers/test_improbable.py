"""Answers that others outweigh: a "consistent", and a curve."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from linear_machine import AXES, CANDIDATES, INSTANTS, equations_of, problem_of, table

from regolithd.calibration.mismatch.inference.other_answers import improbable
from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative, alternatives
from regolithd.calibration.mismatch.inference.other_answers.improbable import (
    in_probable_regions,
    over_time_if_improbable,
    unexplained_if_improbable,
    without_improbable_curves,
)
from regolithd.calibration.mismatch.regression.groups.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_smooth_term
from regolithd.calibration.mismatch.selection.decision import Decision, decide

if TYPE_CHECKING:
    import pytest


def decided(drag: float | np.ndarray) -> Decision:
    """Return what is decided of a recording with a drag of this size."""
    equations = equations_of(problem_of(table(drag=drag)))
    return decide(equations.over(with_smooth_terms(equations.design)), CANDIDATES)


def without_names(decision: Decision) -> Decision:
    """Return the decision as if its names had failed a test of their own."""
    nothing = decision.equations.fit(())
    return replace(decision, named=nothing, unnamed=(), whole=nothing)


def test_nothing_stays_nothing_where_it_is_most_probable() -> None:
    """A sound recording is consistent."""
    decision = without_names(decided(0.0))
    assert unexplained_if_improbable(decision) is decision


def test_a_name_that_is_most_probable_stays() -> None:
    """A clear effect is named."""
    decision = decided(0.3)
    assert unexplained_if_improbable(decision) is decision


def test_nothing_is_unexplained_where_an_effect_is_more_probable() -> None:
    """What failed a test of names is there: a curve over its covariate, on its wheels, is left."""
    named = decided(0.3)
    (term,) = named.named.terms
    decision = unexplained_if_improbable(without_names(named))
    (curve,) = decision.unnamed
    assert not decision.named.terms
    assert curve.wheels == term.wheels
    assert decision.whole.terms == (curve,)


def test_a_name_gives_way_to_an_answer_with_a_curve_that_is_more_probable(monkeypatch: pytest.MonkeyPatch) -> None:
    """That answer has passed every test, and more evidence than all others together."""
    decision = decided(0.3)
    (term,) = decision.named.terms
    curves = best_of_each_smooth_term(decision.equations, (term,))
    ahead = Alternative(("drag", "unexplained"), -20.0, (term, curves[0][1]))
    monkeypatch.setattr(improbable, "alternatives", lambda _: (ahead,))
    found = unexplained_if_improbable(decision)
    assert found.named.terms == (term,)
    assert found.unnamed == (curves[0][1],)
    assert found.whole.terms == ahead.terms
    behind = replace(ahead, margin=1.0)
    monkeypatch.setattr(improbable, "alternatives", lambda _: (behind,))
    assert unexplained_if_improbable(decision) is decision


def with_curve(decision: Decision) -> Decision:
    """Return the decision with the best curve in the place of its names."""
    equations = decision.equations
    curve = best_of_each_smooth_term(equations, ())[0][1]
    return replace(decision, named=equations.fit(()), unnamed=(curve,), whole=equations.fit((curve,)))


def test_a_curve_that_is_more_probable_than_nothing_stays() -> None:
    """It has much evidence."""
    decision = with_curve(decided(0.3))
    assert without_improbable_curves(decision) is decision


def test_a_curve_that_is_less_probable_than_nothing_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is told of a sound recording is nothing, and that curve is no alternative any more."""
    decision = with_curve(decided(0.0))
    assert without_improbable_curves(decision) is decision  # it gains too little to be decided by evidence
    monkeypatch.setattr(improbable, "decided_by_evidence", lambda _: True)
    found = without_improbable_curves(decision)
    assert not found.unnamed
    assert not found.whole.terms
    assert all(other.effects != ("unexplained",) for other in alternatives(found))


def test_a_curve_stays_where_regions_in_its_place_are_improbable(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is more probable than nothing is not lost with the regions that describe it better."""
    decision, nothing = with_curve(decided(0.3)), without_names(decided(0.3))
    regional = replace(decision)
    monkeypatch.setattr(improbable, "in_regions", lambda _: regional)
    assert in_probable_regions(decision) is regional
    improbable_ones = {id(regional)}
    monkeypatch.setattr(
        improbable, "without_improbable_curves", lambda each: nothing if id(each) in improbable_ones else each
    )
    assert in_probable_regions(decision) is decision
    improbable_ones.add(id(decision))
    assert in_probable_regions(decision) is nothing


def test_spells_that_an_improbable_curve_stood_for_are_unexplained(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three spells of a drag happen to be at some speeds: a curve over the speed goes, and they stay."""
    spells = np.zeros((INSTANTS, AXES))
    for begin in (120, 390, 610):
        spells[begin : begin + 20, 0] = 0.5
    decision = without_names(decided(spells))
    equations = decision.equations
    over_speed = [group for group in equations.design.groups if group.name == "wheel_speed" and not group.named]
    curve = next(term for _, term in equations.further((), over_speed) if term.wheels == (0,))
    monkeypatch.setattr(improbable, "decided_by_evidence", lambda _: True)
    found = without_improbable_curves(replace(decision, unnamed=(curve,), whole=equations.fit((curve,))))
    assert [(term.name, term.wheels) for term in found.unnamed] == [("time", (0,))]
    assert len(found.intermittent) == 1


def test_what_another_covariate_does_not_hold_is_left_over_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A curve that held-out readings refuted is not refused twice: what has most evidence beside it is there."""
    decision = without_names(decided(np.where(np.arange(INSTANTS) > INSTANTS // 2, 0.3, 0.0)[:, None]))
    refuted = replace(decision, refused=frozenset({frozenset({"unexplained"})}))
    ahead = Alternative(("drag", "unexplained"), -20.0)
    monkeypatch.setattr(improbable, "alternatives", lambda _, refused: (ahead,) if refused else ())
    (curve,) = over_time_if_improbable(refuted).unnamed
    assert curve.name == "time"
    assert over_time_if_improbable(decision) is decision  # nothing was refuted
    same = replace(ahead, effects=("unexplained",))
    monkeypatch.setattr(improbable, "alternatives", lambda _, refused: (same,) if refused else ())
    assert over_time_if_improbable(refuted) is refuted  # that is what was refuted
