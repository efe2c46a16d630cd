"""Curves over a fleet: which are looked for, and what their columns are in one recording."""

from __future__ import annotations

import numpy as np
import pytest
from heated_room import MEMORY_s, Room, recorded
from law_problem import LOAD, SPEED, problem
from sample_answer import FINDINGS
from synthetic_fleet import DEVIATION, GROUPS

from regolithd.calibration.mismatch.fleet.work import curves
from regolithd.calibration.mismatch.fleet.work.curves import with_curves_of
from regolithd.calibration.mismatch.fleet.work.fleet_curve import FleetCurve
from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm, found_in
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.state.state_memory import through_state
from regolithd.calibration.mismatch.regression.groups.state_groups import ON_STATE

RANGES = {"load": (40.0, 60.0), "time": (0.0, 60.0), "wheel_speed": (0.0, 0.3), "still": (2.0, 2.0)}


def found(*terms: FoundTerm, ranges: dict[str, tuple[float, float]] = RANGES, usual: str = "drag") -> Found:
    """Return what a recording shows."""
    return Found(FINDINGS, {}, DEVIATION, 1.0, 0.1, 8.0, terms, {}, ranges=ranges, couplings=(usual,))


def curve(name: str, coupling: str, *, named: bool = False) -> FoundTerm:
    """Return a term that a recording shows by itself."""
    return FoundTerm(name, named, {}, (0, 1), 2.0, np.zeros((1, 1, 2), np.float32), coupling)


def looked_for(recordings: list[Found]) -> list[tuple[object, object]]:
    """Return covariates and couplings of the curves that are looked for."""
    groups = with_curves_of(GROUPS, recordings)
    assert groups[: len(GROUPS)] == GROUPS
    assert not any(group.named for group in groups[len(GROUPS) :])
    return [(group.shape["over"], group.shape["coupling"]) for group in groups[len(GROUPS) :]]


def test_what_most_recordings_show_is_looked_for_first_and_then_the_usual() -> None:
    """Over no time, which begins anew in each recording, and over nothing that does not vary; no sine."""
    shown = [curve("load", "gain"), curve("time", "drag"), curve("wheel_speed", "drag, periodic")]
    recordings = [found(curve("wheel_speed", "offset")), found(*shown), found(curve("load", "gain")), found()]
    usual = [("load", "drag"), ("wheel_speed", "drag")]
    assert looked_for(recordings) == [("load", "gain"), ("wheel_speed", "offset"), *usual]


def test_a_name_is_no_curve() -> None:
    """Even one that is called as a covariate is."""
    assert looked_for([found(curve("load", "offset", named=True), usual="offset")])[0] == ("load", "offset")
    assert len(looked_for([found(curve("load", "gain", named=True))])) == 2


def test_knots_reach_over_all_recordings() -> None:
    """From the least to the greatest value."""
    groups = with_curves_of(GROUPS, [found(), found(ranges={"load": (35.0, 55.0)})])
    (load,) = [group for group in groups if group.shape.get("over") == "load"]
    assert (load.shape["low"], load.shape["high"], load.tried) == (35.0, 60.0, 2)


def test_there_are_as_many_as_memory_allows(monkeypatch: pytest.MonkeyPatch) -> None:
    """None where the names' columns take it all."""
    columns = sum(len(group.columns) for group in GROUPS)
    for curves_allowed in (0, 1, 2):
        size = columns + len(FleetCurve.coefficients) * curves_allowed
        monkeypatch.setattr(curves, "MOST_BYTES", 8 * len(DEVIATION) * size**2)
        assert len(looked_for([found()])) == curves_allowed


def test_the_columns_of_a_curve_are_hat_functions_times_how_it_acts() -> None:
    """As a smooth term has them, between knots at even distances."""
    shape: dict[str, float | str] = {"over": "load", "coupling": "drag", "low": 40.0, "high": 60.0}
    columns = FleetCurve().columns(problem(), shape)
    knots = np.linspace(40.0, 60.0, len(columns))
    assert np.allclose(np.tensordot(knots, columns, axes=1), np.sign(SPEED) * np.clip(LOAD, 40.0, 60.0))
    assert len(FleetCurve().columns(problem(), {**shape, "over": "humidity"})) == 0
    assert len(FleetCurve().columns(problem(), {**shape, "coupling": ON_STATE})) == 0


def test_a_curve_on_a_state_is_seen_through_it() -> None:
    """With the state's memory."""
    here = build_problem(recorded(1), Room(), {name: prior.value for name, prior in Room.parameters.items()})
    shape: dict[str, float | str] = {"over": "wind", "coupling": ON_STATE, "low": 0.0, "high": 10.0}
    columns = FleetCurve().columns(here, shape)
    wind = np.tensordot(np.linspace(0.0, 10.0, len(columns)), columns, axes=1)
    expected = through_state(here, np.clip(here.covariates["wind"], 0.0, 10.0), MEMORY_s)
    assert wind == pytest.approx(expected, rel=0.05, abs=0.05)


def test_a_recording_says_over_what_a_curve_may_be_and_how_it_would_act() -> None:
    """On the state, where the simulation has one."""
    shown = found_in(recorded(1), Room(), Room.channel)
    assert shown.couplings == (ON_STATE, "offset")
    low, high = shown.ranges["wind"]
    assert 0 <= low < high
    assert shown.step_s == 60.0
    assert shown.first_s < shown.last_s
    assert shown.lagged.count == len(recorded(1).time_s)
