"""How large an effect is in each recording, by its course over the dates."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.fleet.choice.courses import MOST_DATES, Course, courses_over

WHEN = np.array([0.0, 10.0, 20.0, 40.0])


@pytest.mark.parametrize(
    ("course", "sizes"),
    [
        (Course("always"), [1, 1, 1, 1]),
        (Course("since", 2), [0, 0, 1, 1]),
        (Course("until", 2), [1, 1, 0, 0]),
        (Course("growing", 2, 1.0), [0, 0, 1 / 3, 1]),
        (Course("growing", 2, 2.0), [0, 0, 1 / 9, 1]),
    ],
)
def test_a_course_gives_each_recording_its_size(course: Course, sizes: list[float]) -> None:
    """Growth begins at the last recording without it, and is 1 in the last of all."""
    np.testing.assert_allclose(course.factors(range(4), WHEN), sizes)


def test_what_is_a_change_by_its_nature_begins_later() -> None:
    """It was not there from the start, and does not end."""
    assert {course.kind for course in courses_over(range(4), begins=True)} == {"since", "growing"}
    assert {course.kind for course in courses_over(range(4), begins=False)} == {"always", "since", "until"}
    assert courses_over([3], begins=True) == []


def test_in_fewer_recordings_the_date_is_of_the_next_that_is_left() -> None:
    """The recording at which an effect of several rovers begins may be one of a rover that does not show it."""
    since = Course("since", 1)
    assert since.among([0, 2, 3], WHEN) == Course("since", 2)
    np.testing.assert_allclose(since.among([0, 2, 3], WHEN).factors([0, 2, 3], WHEN), [0, 1, 1])
    assert since.among([0, 1, 3], WHEN) is since
    assert Course("always").among([2, 3], WHEN) == Course("always")


def test_the_dates_of_a_long_season_are_thinned_out() -> None:
    """Not more than so many are searched, the first and the last among them."""
    dates = [course.first for course in courses_over(range(500), begins=True) if course.kind == "since"]
    assert len(dates) <= MOST_DATES
    assert (dates[0], dates[-1]) == (1, 499)
