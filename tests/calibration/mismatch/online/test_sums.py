"""The course of sums: what is merged adds up, and is bounded."""

from __future__ import annotations

import numpy as np

from regolithd.calibration.mismatch.online.sums import Course, Interval, sums_of

WHEELS, COLUMNS, INSTANTS = 2, 3, 20


def intervals(count: int) -> list[Interval]:
    """Return intervals of random content, a minute each."""
    rng = np.random.default_rng(1)
    shape = (INSTANTS, WHEELS)
    return [
        Interval(
            60.0 * k,
            60.0 * (k + 1),
            rng.normal(size=(COLUMNS, *shape)),
            rng.normal(size=shape),
            np.ones(shape, np.bool_),
            1.0,
        )
        for k in range(count)
    ]


def course_of(parts: list[Interval], most: int, kept_s: tuple[float, ...] = ()) -> Course:
    """Return the course of intervals."""
    course = Course(most)
    for part in parts:
        course.add(part.start_s, sums_of(part), kept_s)
    return course


def test_the_sums_from_each_start_are_those_of_all_rows_since() -> None:
    """Gram matrix and moments of a suffix are those of its rows in one product."""
    parts = intervals(5)
    suffixes = course_of(parts, 8).suffixes()
    columns = np.concatenate([part.columns for part in parts[2:]], axis=1)
    residual = np.concatenate([part.residual for part in parts[2:]])
    for wheel in range(WHEELS):
        here = columns[:, :, wheel]
        np.testing.assert_allclose(suffixes.gram[2, wheel], here @ here.T)
        np.testing.assert_allclose(suffixes.moment[2, wheel], here @ residual[:, wheel])


def test_memory_does_not_grow_with_the_recording() -> None:
    """After a hundred intervals there are as many segments as allowed, and their sums are those of all rows."""
    parts = intervals(100)
    bounded, whole = course_of(parts, 12), course_of(parts, 1000)
    assert len(bounded.segments) == 12
    np.testing.assert_allclose(bounded.suffixes().gram[0], whole.suffixes().gram[0])


def test_recent_intervals_stay_apart_and_old_ones_are_merged() -> None:
    """The lengths of the segments fall from the oldest to the latest, whose length is one interval."""
    starts = course_of(intervals(200), 16).suffixes().starts_s
    lengths = np.diff(starts)
    assert starts[0] == 0.0
    assert lengths[-1] == 60.0
    assert lengths[0] > 10 * lengths[-1]


def test_the_onset_of_a_reported_change_stays_a_boundary() -> None:
    """However old it is."""
    assert 600.0 in course_of(intervals(300), 12, (600.0,)).suffixes().starts_s
