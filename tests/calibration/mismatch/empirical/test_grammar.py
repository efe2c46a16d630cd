"""The closed forms that curves are compared with: none twice, and none that a parabola is as well."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.empirical.grammar import Span, grammar
from regolithd.calibration.mismatch.empirical.suggestions import FittedForm, in_a_gap, span_of

RANGES = [Span(0.2, 3.0, 0.2), Span(-3.0, -0.2, 0.2), Span(-1.0, 2.0, 0.0)]


@pytest.mark.parametrize("span", RANGES)
def test_no_two_powers_are_the_same_function_on_a_range(span: Span) -> None:
    """On one side of zero an odd power is an even one or its negative; each is suggested once."""
    x = np.linspace(span.low, span.high, 31)
    forms = [form for form in grammar() if form.family == "power" and not form.names and form.suits(span)]
    columns = np.stack([form.of(x, np.zeros(0))[0] for form in forms])
    columns /= np.linalg.norm(columns, axis=1, keepdims=True)
    alike = np.abs(columns @ columns.T) - np.eye(len(forms))
    assert len(forms) > 3
    assert alike.max() < 1 - 1e-6
    assert {"c x", "c |x|"} & {form.text for form in forms}


def test_a_sine_has_half_a_cycle_or_more_within_the_range() -> None:
    """Its periods are positive; one with fewer cycles is a parabola."""
    (sine,) = (form for form in grammar() if form.family == "sine")
    periods = sine.shapes(Span(-1.0, 2.0, 0.0))[:, 0]
    assert np.all(periods > 0)
    assert periods.max() == pytest.approx(2 * 3.0)


def test_nothing_is_fitted_between_the_values_of_a_gear() -> None:
    """A sine of less than three gears a cycle, or a bump between two gears, could have any size there."""
    gears = span_of(np.array([1.0, 2.0, 3.0, 4.0, 5.0]))
    assert gears.usual_step == 1.0
    forms = {form.text: form for form in grammar() if form.suits(gears)}
    assert forms["c cos(2π x/k) + d sin(2π x/k)"].shapes(gears).min() == pytest.approx(3.0)
    for form in forms.values():
        if "k" in form.names and form.family != "sine":
            assert form.shapes(gears)[:, form.names.index("k")].min() == pytest.approx(0.25)
    assert not any(form.family == "sine" and form.suits(span_of(np.array([0.0, 1.0]))) for form in grammar())


def test_the_gaps_of_a_continuous_covariate_limit_nothing() -> None:
    """A sine has 24 cycles at most, and widths begin at three of two hundred parts of the range."""
    (sine,) = (form for form in grammar() if form.family == "sine")
    span = span_of(np.linspace(0.0, 1.0, 240))
    assert sine.shapes(span).min() == pytest.approx(1 / 24)
    assert span.narrowest == pytest.approx(0.015)


def test_one_gap_in_a_continuous_covariate_limits_neither_sine_nor_bump() -> None:
    """Where the values beyond a gap of an eighth are few, four cycles or a narrow bump are looked for all the same."""
    (sine,) = (form for form in grammar() if form.family == "sine")
    span = span_of(np.concatenate((np.linspace(0.0, 0.8, 200), np.linspace(0.93, 1.0, 5))))
    assert sine.shapes(span).min() == pytest.approx(1 / 24)
    assert span.narrowest == pytest.approx(0.015)


@pytest.mark.parametrize(("place", "width", "lost"), [(350.0, 45.0, False), (100.0, 20.0, True), (100.0, 120.0, False)])
def test_a_bump_between_all_values_is_none(place: float, width: float, lost: bool) -> None:
    """A roller without a log has diameter 0, and no log is thinner than 210 mm: what is between has any size."""
    (bump,) = (form for form in grammar() if form.family == "bump")
    diameters = np.concatenate(([0.0], np.linspace(210.0, 510.0, 200)))
    found = FittedForm(bump, False, np.array([place, width]), np.ones(1), 0.0)
    assert in_a_gap(found, diameters) is lost
