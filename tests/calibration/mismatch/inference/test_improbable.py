"""A "consistent" that other answers outweigh is unexplained."""

from __future__ import annotations

from dataclasses import replace

from linear_machine import CANDIDATES, equations_of, problem_of, table

from regolithd.calibration.mismatch.inference.improbable import unexplained_if_improbable
from regolithd.calibration.mismatch.regression.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.selection.decision import Decision, decide


def decided(drag: float) -> Decision:
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
