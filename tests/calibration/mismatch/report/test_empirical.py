"""The report's part about a curve without a name."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from regolithd.calibration.mismatch.answer import EmpiricalFit, Parameter, Suggestion, Unexplained
from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve, StatedCurve
from regolithd.calibration.mismatch.report.empirical import empirical_section
from regolithd.calibration.mismatch.report.labels import Labels

CURVE = EmpiricalCurve(
    "drag", True, "A", "m/s", (0.1, 0.4, 0.7), (0.0, 0.1, 0.15), (-0.1, 0.05, 0.1), (0.1, 0.15, 0.2), 0.4, 0.2
)
FORM = Suggestion("power", "Δcurrent_A = c speed", {"c": Parameter(0.25, 0.2, 0.3, "A/(m/s)")}, 0.21, 0.0)
PLACE = Unexplained("current_A", (1,), "speed", 0.0, 9.0, 0.4, curve=CURVE, suggestions=(FORM,))
FIT = EmpiricalFit(
    StatedCurve("current_A", (1,), "speed", CURVE),
    {},
    (),
    at=np.array([0.05, 0.2, 0.6]),
    mean=np.array([0.0, 0.03, 0.12]),
    standard_error=np.full(3, 0.01),
    suggested=np.array([0.025, 0.1, 0.175]),
)


def test_the_drawing_has_band_curve_points_and_the_first_suggestion() -> None:
    """Points outside the curve's range are left out."""
    told = empirical_section(PLACE, SimpleNamespace(unit="A", empirical=(FIT,)), Labels())  # type: ignore[arg-type]
    assert told.svg.count("<polygon") == 1
    assert told.svg.count("<circle") == 2
    assert 'class="after line suggested"' in told.svg
    assert "|speed|" in told.svg


def test_a_point_that_is_hardly_known_does_not_flatten_the_curve() -> None:
    """Its bar is cut at the edge of the drawing, and the scale is that of the others; its mean is not shown."""

    def drawing(error: float) -> str:
        fit = replace(
            FIT,
            at=np.array([0.2, 0.3, 0.4, 0.6]),
            mean=np.array([error, 0.03, 0.05, 0.12]),
            standard_error=np.array([error, 0.01, 0.01, 0.01]),
        )
        evidence = SimpleNamespace(unit="A", empirical=(fit,))
        return empirical_section(PLACE, evidence, Labels()).svg  # type: ignore[arg-type]

    known, hardly = drawing(0.01), drawing(10.0)
    assert known.count("<circle") == 4
    assert hardly.count("<circle") == 3
    bars = [path.split('"')[0] for path in hardly.split('class="before bar" d="')[1:]]
    assert len(bars) == 4
    assert all(0 <= float(height) <= 270 for bar in bars for height in re.findall(r" (\d+\.\d)", bar))


def test_the_texts_say_how_it_acts_and_what_it_brings() -> None:
    """Errors without and with it, and each form with its interval."""
    told = empirical_section(PLACE, SimpleNamespace(unit="A", empirical=()), Labels())  # type: ignore[arg-type]
    assert (told.before, told.after, told.unit) == ("0.4", "0.2", "A")
    assert re.match(r"It acts against the motion", told.acts)
    assert told.caution == ""
    assert told.forms[0].parameters == "c = 0.25 (0.20 … 0.30) A/(m/s)"
    assert 'class="after line suggested"' not in told.svg


@pytest.mark.parametrize("after", [0.4, 0.39999, 0.41])
def test_a_curve_that_does_not_help_where_it_was_not_fitted_has_a_caution(after: float) -> None:
    """Also one whose gain is less than percent with one decimal show."""
    place = replace(PLACE, curve=replace(CURVE, held_out_rmse_after=after))
    told = empirical_section(place, SimpleNamespace(unit="A", empirical=()), Labels())  # type: ignore[arg-type]
    assert told.caution.startswith("The curve does not lower the error of readings that it was not fitted to")
