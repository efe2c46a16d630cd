"""Other choices of a fleet, and by how much the chosen one is ahead of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from synthetic_fleet import drive, equations_of, on_both

from regolithd.calibration.mismatch.fleet.choice.alternatives import other_choices
from regolithd.calibration.mismatch.fleet.choice.search import places_of
from regolithd.calibration.mismatch.fleet.choice.selection import Chooser, without
from regolithd.calibration.mismatch.inference.other_answers.alternatives import LARGEST_MARGIN

if TYPE_CHECKING:
    from collections.abc import Mapping

ROVER = (0, 1) * 5
ENTRY = 8.0


def chooser(concealed: Mapping[int, Mapping[tuple[int, int], float]]) -> Chooser:
    """Return the choice from two rovers with five recordings each, with effects in some of them."""
    of = equations_of([drive(100 + n, concealed.get(n)) for n in range(10)], ROVER)
    return Chooser(of, places_of(of), ENTRY)


def test_where_an_effect_is_clear_no_other_choice_comes_near() -> None:
    """One without it is too far behind to count, and one more gains less than it must."""
    choice = chooser({n: on_both(3, 0.3) for n in range(10)})
    fit = choice.chosen()
    assert [term.name for term in fit.terms] == ["wave"]
    assert all(len(other.effects) > 1 and other.margin > 0 for other in other_choices(choice, fit))


def test_an_effect_that_just_enters_has_the_answer_without_it_near() -> None:
    """By what it gains beyond its entry."""
    for size in (0.016, 0.017, 0.018, 0.019, 0.02, 0.021):
        choice = chooser({n: on_both(3, size) for n in range(10)})
        fit = choice.chosen()
        if fit.terms:
            break
    assert fit.terms
    margin = choice.evidence(fit) - choice.evidence(choice.equations.fit(without(fit, 0)))
    assert 0 < margin < LARGEST_MARGIN
    (nothing,) = (other for other in other_choices(choice, fit) if not other.effects)
    assert nothing.margin == pytest.approx(margin)


def test_a_refused_effect_is_as_probable_at_most() -> None:
    """Where an effect was dropped that has evidence, the choice with it is no more probable than the one without."""
    choice = chooser({n: on_both(3, 0.3) for n in range(10)})
    others = other_choices(choice, choice.equations.fit(()))
    assert others[0].effects == ("wave",)
    assert others[0].margin == 0
