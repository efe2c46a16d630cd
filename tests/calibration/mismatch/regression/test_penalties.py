"""Penalties: what a term pays for its freedom, and what its own channel credits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from regolithd.calibration.mismatch.candidates.candidate import Candidate
from regolithd.calibration.mismatch.regression.group import Group, Term
from regolithd.calibration.mismatch.regression.penalties import (
    full_penalty,
    own_channel_credit,
    penalties,
    penalty,
    visible_in_own_channel,
)
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

GROUP = Group("x", (0, 1, 2), (0, 0, 0), ("all", "one"), selection_penalty=1.5)


def test_each_coefficient_costs_what_akaike_asks() -> None:
    """Two each, and the price of the shape's selection."""
    assert full_penalty(Term(GROUP, (0, 1)), 2, THRESHOLDS) == 3 * 2 + 1.5


def test_some_wheels_alone_cost_their_choice() -> None:
    """Two logarithms of the choices, and the odds where all wheels might have it."""
    chosen = 2 * np.log(2 * 6)
    assert full_penalty(Term(GROUP, (4,)), 6, THRESHOLDS) == pytest.approx(7.5 + chosen + 6)
    alone = replace(GROUP, sharing=("one",))
    assert full_penalty(Term(alone, (4,)), 6, THRESHOLDS) == pytest.approx(7.5 + chosen)


def test_columns_that_do_nothing_on_a_wheel_cost_nothing_there() -> None:
    """A sine of each wheel has coefficients of its own."""
    acting = np.array([[True, False], [True, False], [False, True]])
    group = replace(GROUP, acting=acting, sharing=("one",))
    first, second = (full_penalty(Term(group, (w,)), 2, THRESHOLDS) for w in (0, 1))
    assert first - second == pytest.approx(2)


def test_the_table_of_penalties_is_that_of_each_term() -> None:
    """On all wheels or on one, with columns that act on some of them or on all, and with a channel of its own."""
    acting = np.array([[True, False], [True, False], [False, True]])
    groups = (
        GROUP,
        replace(GROUP, sharing=("one",)),
        replace(GROUP, acting=acting),
        replace(GROUP, acting=acting, sharing=("one",)),
        replace(GROUP, own_channel=(np.array([40.0, 1e4]), np.ones(2))),
    )
    sets = ((0,), (1,), (0, 1))
    each = [[penalty(Term(group, wheels), 2, THRESHOLDS) for group in groups] for wheels in sets]
    np.testing.assert_array_equal(penalties(groups, sets, 2, THRESHOLDS), each)


@pytest.mark.parametrize(("gain", "credit", "visible"), [(10.0, 5.0, False), (40.0, 20.0, True), (1e4, 300.0, True)])
def test_a_fault_s_own_channel_credits_half_of_its_gain(gain: float, credit: float, *, visible: bool) -> None:
    """Up to a limit, and below another it is not there at all."""
    group = replace(GROUP, own_channel=(np.array([1e6, gain]), np.ones(2)), sharing=("one",))
    term = Term(group, (1,))
    assert own_channel_credit(term, THRESHOLDS) == credit
    assert visible_in_own_channel(term, THRESHOLDS) is visible
    assert penalty(term, 2, THRESHOLDS) == full_penalty(term, 2, THRESHOLDS) - credit


def test_what_has_no_other_channel_is_visible_and_gets_no_credit() -> None:
    """Most effects are in the predicted channel itself."""
    term = Term(GROUP, (0, 1))
    assert own_channel_credit(term, THRESHOLDS) == 0
    assert visible_in_own_channel(term, THRESHOLDS)


def test_smooth_terms_are_shared_as_they_say_and_candidates_by_some_too() -> None:
    """Only a candidate that may be on one wheel or on all may be on some."""
    assert GROUP.may_be_shared("all")
    assert not GROUP.may_be_shared("some"), "a smooth term"
    assert not replace(GROUP, sharing=("all",)).may_be_shared("one")
    assert GROUP.span == slice(0, 3)


def test_the_wheels_of_a_change_were_known_before() -> None:
    """A corrected effect says which wheels have it: its change costs no choice of them."""
    changed = Candidate()
    changed.stated_size = 1.0  # type: ignore[misc]
    group = replace(GROUP, candidate=changed, sharing=("one",))
    assert full_penalty(Term(group, (4,)), 6, THRESHOLDS) == pytest.approx(7.5)
    assert group.law == ("x", True)
