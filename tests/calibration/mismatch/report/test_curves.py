"""Which curve an effect has: its covariate or what stands for it, its bins, its sign, and its error."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from regolithd.calibration.mismatch.answer import Evidence
from regolithd.calibration.mismatch.report.curves import curve_of
from regolithd.calibration.mismatch.report.labels import Labels

ROWS, WHEELS = 300, 2
RANDOM = np.random.default_rng(3)
TIME_S = 2.0 * np.arange(ROWS)
SPEED = RANDOM.uniform(-1, 1, (ROWS, WHEELS))
LEFT = RANDOM.normal(0, 0.1, (ROWS, WHEELS))
OFFSET = 0.4


def seen(*, row: Any = None, **covariates: Any) -> Evidence:
    """Return ten minutes of two wheels with an offset before the effects, and noise after them."""
    known = {"time": np.broadcast_to(TIME_S[:, None], SPEED.shape), "wheel_speed": SPEED, **covariates}
    mask, reverses = np.ones(SPEED.shape, np.bool_), "direction" in known
    problem = SimpleNamespace(covariates=known, row=row, mask=mask, stated=(), reverses=reverses)
    nothing = np.zeros((1, WHEELS))
    return Evidence(
        channel="motor_current_A",
        unit="A",
        time_s=TIME_S,
        wheels=(1, 2),
        measured=LEFT + OFFSET,
        before=np.zeros(SPEED.shape),
        after=np.full(SPEED.shape, OFFSET),
        map_time_s=TIME_S[:1],
        map_before=nothing,
        map_after=nothing,
        curves=(),
        values={},
        contributions=(),
        problem=problem,  # type: ignore[arg-type]
    )


def test_a_covariate_has_bins_of_equal_numbers() -> None:
    """22 of them, from the smallest value to the largest, with the mean residual before and after in each."""
    curve = curve_of(seen(), "wheel_speed", (1, 2))
    assert curve is not None
    assert (curve.covariate, curve.coupling, curve.wheels) == ("wheel_speed", "offset", (1, 2))
    assert len(curve.at) == 22
    assert np.all(np.diff(curve.at) > 0)
    order = np.argsort(SPEED, axis=None)
    first, last = (LEFT.ravel()[part] for part in (order[: 600 // 22], order[-600 // 22 :]))
    assert curve.after[0] == pytest.approx(np.mean(first), abs=0.01)
    assert curve.after[-1] == pytest.approx(np.mean(last), abs=0.01)
    np.testing.assert_allclose(curve.before, curve.after + OFFSET)


def test_the_error_is_of_sums_over_half_a_minute() -> None:
    """So that readings that follow each other count as what they are; the bins share it by the root of their number."""
    curve = curve_of(seen(), "time", (2,))
    assert curve is not None
    blocks = [LEFT[(start <= TIME_S) & (start + 30 > TIME_S), 1].sum() for start in np.arange(0, 600, 30)]
    of_one = np.sqrt(np.sum(np.square(blocks)) / ROWS)
    np.testing.assert_allclose(np.mean(curve.standard_error), of_one / np.sqrt(ROWS / 22), rtol=0.02)


@pytest.mark.parametrize(
    ("covariate", "along_motion", "shown", "coupling", "sign"),
    [
        ("time", True, "time", "drag", True),
        ("time", False, "time", "offset", False),
        ("direction", True, "wheel_speed", "offset", False),
        ("none", True, "time", "drag", True),
    ],
)
def test_a_drag_is_shown_along_the_motion(
    covariate: str, along_motion: bool, shown: str, coupling: str, sign: bool
) -> None:
    """An effect of the direction itself is shown over the speed, a constant over time."""
    curve = curve_of(seen(direction=np.sign(SPEED)), covariate, (1, 2), along_motion=along_motion)
    assert curve is not None
    assert (curve.covariate, curve.coupling) == (shown, coupling)
    mean = float(np.mean((LEFT + OFFSET) * (np.sign(SPEED) if sign else 1.0)))
    assert float(np.mean(curve.before)) == pytest.approx(mean, abs=0.01)


def test_without_a_direction_nothing_is_along_the_motion() -> None:
    """A machine without a speed."""
    curve = curve_of(seen(), "time", (1,), along_motion=True)
    assert curve is not None
    assert curve.coupling == "offset"


def test_rows_of_wheels_have_a_bin_each() -> None:
    """One row alone, or a machine without rows, has no curve over them."""
    curve = curve_of(seen(row=np.array([0.0, 1.0])), "wheel_row", (1, 2))
    assert curve is not None
    np.testing.assert_allclose(curve.at, [0.0, 1.0])
    np.testing.assert_allclose(curve.after, LEFT.mean(axis=0), atol=1e-12)
    assert curve_of(seen(row=np.array([0.0, 0.0])), "wheel_row", (1, 2)) is None
    assert curve_of(seen(), "wheel_row", (1, 2)) is None


def test_a_few_distinct_values_have_a_bin_each() -> None:
    """Up to half as many as a curve has bins; of more, neighbours may share a bin, and no bin is without a value."""
    gears = [np.broadcast_to((np.arange(ROWS) % n)[:, None], SPEED.shape).astype(float) for n in (11, 12)]
    few, more = (curve_of(seen(gear=gear), "gear", (1, 2)) for gear in gears)
    assert few is not None
    assert more is not None
    np.testing.assert_allclose(few.at, np.arange(11), atol=1e-9)
    assert 9 <= len(more.at) <= 12
    assert np.all(np.diff(more.at) > 0)


@pytest.mark.parametrize(("known", "drawn"), [(219, False), (220, True)])
def test_a_curve_needs_ten_values_for_each_bin(known: int, drawn: bool) -> None:
    """Of these wheels, where covariate and prediction are known."""
    temperature = np.where(np.arange(ROWS)[:, None] < known, SPEED, np.nan)
    assert (curve_of(seen(temperature=temperature), "temperature", (1,)) is not None) == drawn
    before = np.where(np.arange(ROWS)[:, None] < known, 0.0, np.nan) * np.ones(WHEELS)
    assert (curve_of(replace(seen(), before=before), "time", (1,)) is not None) == drawn


def test_there_is_no_curve_of_what_is_not_there() -> None:
    """A covariate that was not recorded, and the turned angle, over which everything is periodic."""
    assert curve_of(seen(), "temperature", (1, 2)) is None
    assert curve_of(seen(wheel_angle=SPEED), "wheel_angle", (1, 2)) is None


@pytest.mark.parametrize(("length_s", "unit"), [(180.0, "s"), (180.5, "min"), (18_000.0, "min"), (18_001.0, "h")])
def test_a_recording_has_minutes_on_its_axes_from_three_minutes_on_and_hours_from_five(
    length_s: float, unit: str
) -> None:
    """From its first instant to its last, wherever the clock began."""
    evidence = replace(seen(), time_s=1000 + np.linspace(0, length_s, ROWS), candidates=())
    assert Labels.of(evidence).time_unit == unit


def test_a_span_of_hours_is_told_to_a_hundredth() -> None:
    """It is 36 s."""
    assert Labels(time_unit="h").from_to(0.0, 35_000.0) == "0.00 to 9.72 h"


@pytest.mark.parametrize(("unit", "size", "in_milli"), [("A", 0.99, True), ("A", 1.01, False), ("N", 0.5, False)])
def test_small_currents_are_shown_in_milliamperes(unit: str, size: float, in_milli: bool) -> None:
    """Where their mean size is below one ampere; readings that are absent do not count."""
    measured = np.where(np.arange(ROWS)[:, None] % 2, size, -size) * np.ones(WHEELS)
    measured[0, 0] = np.nan
    assert Labels.of(replace(seen(), unit=unit, measured=measured)).in_milli == in_milli
