"""A table of gains: its entries are the terms that a search asks for."""

from __future__ import annotations

import numpy as np

from regolithd.calibration.mismatch.regression.group import Group, Term
from regolithd.calibration.mismatch.regression.screening.gains import Gains

GROUPS = tuple(Group(name, (k,), (0,), ("all", "one")) for k, name in enumerate(("drag", "time", "drag")))
SETS = ((0,), (1,), (0, 1))
GAINS = Gains(
    GROUPS,
    SETS,
    np.array([[3.0, 0.0, 1.0], [0.0, 2.0, 0.0], [5.0, 4.0, 0.0]]),
    np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [6.0, 3.5, 0.0]]),
)


def test_terms_are_those_that_gain_something() -> None:
    """Each with its own gain, wheel by wheel."""
    found = [(gain, term.group.columns[0], term.wheels) for gain, term in GAINS.terms()]
    assert found == [(3.0, 0, (0,)), (1.0, 2, (0,)), (2.0, 1, (1,)), (5.0, 0, (0, 1)), (4.0, 1, (0, 1))]
    assert GAINS.term(7) == (4.0, Term(GROUPS[1], (0, 1)))


def test_what_is_not_allowed_gains_nothing() -> None:
    """On the other wheels it stays."""
    left = GAINS.where([[True] * 3, [False] * 3, [True, False, True]])
    assert [gain for gain, _ in left.terms()] == [3.0, 1.0, 5.0]


def test_families_and_numbers_of_wheels_part_the_table() -> None:
    """Each entry is in one part."""
    drag, time = GAINS.families(lambda group: group.name)
    assert [gain for gain, _ in drag.terms()] == [3.0, 1.0, 5.0]
    assert drag.groups == (GROUPS[0], GROUPS[2])
    one, both = time.by_number_of_wheels()
    assert ([gain for gain, _ in one.terms()], [gain for gain, _ in both.terms()]) == ([2.0], [4.0])
    assert (one.sets, both.sets) == (((0,), (1,)), ((0, 1),))


def test_the_largest_score_is_that_of_what_gains_something() -> None:
    """What gains nothing costs nothing, and is not the best for that."""
    assert GAINS.largest_score() == (2.0, Term(GROUPS[0], (0,)))
    drag, time = GAINS.families(lambda group: group.name)
    assert (drag.largest_score(), time.largest_score()) == ((2.0, Term(GROUPS[0], (0,))), (1.0, Term(GROUPS[1], (1,))))
    one, both = time.by_number_of_wheels()
    assert (one.largest_score(), both.largest_score()) == ((1.0, Term(GROUPS[1], (1,))), (0.5, Term(GROUPS[1], (0, 1))))
    assert GAINS.where([[False] * 3, [False] * 3, [False, False, True]]).largest_score() is None
