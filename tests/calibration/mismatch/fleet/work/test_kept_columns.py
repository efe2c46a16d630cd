"""Columns of single recordings between the two steps: out of memory, and back as they were."""

from __future__ import annotations

import numpy as np
from sample_answer import FINDINGS

from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm
from regolithd.calibration.mismatch.fleet.work.kept_columns import KeptColumns


def found(seed: int, *counts: int) -> Found:
    """Return what a recording shows: terms of so many columns, stored wheel by wheel."""
    draws = np.random.default_rng(seed)
    columns = [np.swapaxes(draws.normal(size=(n, 2, 40 + seed)).astype(np.float32), 1, 2) for n in counts]
    terms = tuple(FoundTerm("time", False, {}, (0, 1), 2.0, each) for each in columns)
    return Found(FINDINGS, {"mass": 3.0}, np.ones(2), 1.0, 0.1, 8.0, terms, {})


def test_columns_come_back_as_they_were() -> None:
    """Those of each recording, in any order and more than once; the rest is never away."""
    kept, whole = KeptColumns(), {"first": found(1, 2, 1), "second": found(2, 3), "bare": found(3)}
    small = {name: kept.without(name, each) for name, each in whole.items()}
    for name in ("second", "bare", "first", "second"):
        again = kept.restored(name, small[name])
        assert again.values == {"mass": 3.0}
        assert len(again.terms) == len(whole[name].terms)
        for term, expected in zip(again.terms, whole[name].terms, strict=True):
            np.testing.assert_array_equal(term.columns, expected.columns)


def test_what_is_held_has_no_readings_but_the_number_of_columns() -> None:
    """Its arrays are empty."""
    small = KeptColumns().without("first", found(1, 2, 1))
    assert [len(term.columns) for term in small.terms] == [2, 1]
    assert sum(term.columns.nbytes for term in small.terms) == 0
