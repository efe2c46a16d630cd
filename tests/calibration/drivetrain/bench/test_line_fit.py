"""The line fit counts steps, not samples."""

import numpy as np
import pytest

from regolithd.calibration.drivetrain.bench.line_fit import BenchError, fit_line


def test_the_line_is_that_of_polyfit() -> None:
    """With one sample for each step, values and standard deviations are those of an ordinary least-squares fit."""
    rng = np.random.default_rng(0)
    x = np.linspace(0, 10, 12)
    y = 3.0 + 0.5 * x + rng.normal(0, 0.1, x.size)
    fit = fit_line(x, y, np.arange(12.0))
    (slope, offset), covariance = np.polyfit(x, y, 1, cov=True)
    assert (fit.slope, fit.offset) == (pytest.approx(slope), pytest.approx(offset))
    assert (fit.slope_std, fit.offset_std) == tuple(pytest.approx(std) for std in np.sqrt(np.diag(covariance)))


def test_more_samples_of_the_same_steps_change_nothing() -> None:
    """A hundred equal samples of each step give the fit of one."""
    x, y = np.array([0.0, 1.0, 2.0, 4.0]), np.array([0.1, 1.0, 2.2, 3.9])
    steps = np.arange(4.0)
    once, often = fit_line(x, y, steps), fit_line(*(np.repeat(each, 100) for each in (x, y, steps)))
    assert often.slope_std == pytest.approx(once.slope_std)


def test_steps_at_one_value_are_refused() -> None:
    """Three steps of the same weight do not determine a slope."""
    with pytest.raises(BenchError, match="same value"):
        fit_line(np.ones(3), np.arange(3.0), np.arange(3.0))
