"""Which of two decisions about the same readings is told: what one leaves less, against what its terms are charged."""

from __future__ import annotations

from dataclasses import replace

from linear_machine import CANDIDATES, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch.selection.decision import Decision, decide


def decided(drag: float) -> Decision:
    """Return the decision about two axes on which a drag acts."""
    return decide(equations_of(problem_of(table(drag=drag))), CANDIDATES)


def named(decision: Decision, *names: str) -> Decision:
    """Return the decision with these names in the place of its own."""
    fit = decision.equations.fit([term_of(decision.equations, name) for name in names])
    return replace(decision, named=fit, unnamed=(), whole=fit)


def test_a_name_that_explains_nothing_is_charged() -> None:
    """Without it as much is left, but for chance."""
    nothing = decided(0.0)
    assert named(nothing).is_as_probable_as(named(nothing, "drag"))
    assert named(nothing).is_as_probable_as(named(nothing, "drag", "step"))


def test_a_name_that_explains_much_is_not_given_up() -> None:
    """What it leaves is less by far more than it is charged."""
    dragged = decided(0.3)
    assert not named(dragged).is_as_probable_as(named(dragged, "drag"))
    assert not named(dragged, "step").is_as_probable_as(named(dragged, "drag", "step"))
    assert named(dragged, "drag").is_as_probable_as(named(dragged, "drag", "step"))
