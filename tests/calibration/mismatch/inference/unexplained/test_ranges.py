"""The range in words."""

from __future__ import annotations

import pytest
from linear_machine import problem_of, table

from regolithd.calibration.mismatch.answer import Parameter
from regolithd.calibration.mismatch.inference.unexplained.ranges import covariate_unit, in_words

SLOPE = Parameter(0.2147, 0.2077, 0.2234, "rad")


@pytest.mark.parametrize(
    ("covariate", "lower", "upper", "expected"),
    [
        ("pitch", SLOPE, None, "beyond 0.215 rad of pitch (90 % sure: 0.208 to 0.223)"),
        (
            "temperature",
            None,
            Parameter(-4.0, -6.0, 8.0, "degC"),
            "below -4 °C of temperature (90 % sure: -6 to 8)",
        ),
        (
            "wheel_speed",
            Parameter(1.0, 0.8, 2.0, "rad/s"),
            Parameter(3.0, 2.9, 4.0, "rad/s"),
            "between 1.0 and 3.0 rad/s of speed (90 % sure: 0.8 to 2.0 and 2.9 to 4.0)",
        ),
        ("pitch", Parameter(12.3, 11.9, 12.8, "deg"), None, "beyond 12.30° of pitch (90 % sure: 11.90 to 12.80)"),
        ("time", Parameter(812.0, 790.0, 830.0, "s"), None, "from 812 s on (90 % sure: 790 to 830)"),
        ("time", None, Parameter(812.0, 790.0, 830.0, "s"), "until 812 s (90 % sure: 790 to 830)"),
        ("fill", Parameter(0.5, 0.42, 0.6, "1"), None, "beyond 0.50 of fill (90 % sure: 0.42 to 0.60)"),
    ],
)
def test_a_range_reads_as_people_say_it(
    covariate: str, lower: Parameter | None, upper: Parameter | None, expected: str
) -> None:
    """In the recording's unit, and with as many places as the interval allows."""
    assert in_words(covariate, lower, upper, problem_of(table())) == expected


def test_a_bound_has_the_unit_of_its_covariate() -> None:
    """As the column's name has it; seconds for the time."""
    problem = problem_of(table())
    assert covariate_unit(problem, "wheel_speed") == "rad/s"
    assert covariate_unit(problem, "time") == "s"
