"""The closed forms that curves are compared with: none twice, and none that a parabola is as well."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.empirical.grammar import Span, grammar

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
