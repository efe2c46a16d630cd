"""Every candidate's columns against its law, in closed form, on a problem of a few readings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from golden import assert_golden
from law_problem import (
    CANDIDATES,
    LOAD,
    PREDICTED,
    RELATIVE,
    SIGN,
    SPEED,
    STEP_S,
    TIME_S,
    TIMES,
    WARM,
    WHEELS,
    P,
    problem,
)

from regolithd.calibration.mismatch.candidates.growth import growth, onset_grid
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.candidates.load_cell_drift import OFFSETS, DriftOfPredictedLoad, LoadCellDrift
from regolithd.calibration.mismatch.problem.problem import Problem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape

    Array = NDArray[np.float64]

OF_ITS_OWN_RECORDING = {"load-cell-drift"}
"""Effects that are read from the recording itself: a cell's drift."""
EDGE = 33
"""Instants at an end, where a delay looks beyond it."""

LAWS: list[tuple[str, Shape, Array]] = [
    ("coulomb-friction", {}, SIGN),
    ("viscous-friction", {"power": 1.0}, SPEED),
    ("viscous-friction", {"power": 0.7}, SIGN * np.abs(SPEED) ** 0.7),
    ("stribeck-friction", {"stribeck_speed_rad_s": 0.1, "fades": "exponent 1"}, SIGN * np.exp(-np.abs(SPEED) / 0.1)),
    ("stribeck-friction", {"stribeck_speed_rad_s": 0.1, "fades": "exponent 2"}, SIGN * np.exp(-((SPEED / 0.1) ** 2))),
    ("stribeck-friction", {"stribeck_speed_rad_s": 0.1, "exponent": 1.5}, SIGN * np.exp(-(np.abs(SPEED / 0.1) ** 1.5))),
    ("stribeck-friction", {"stribeck_speed_rad_s": 0.1, "fades": "quotient"}, SIGN / (1 + (SPEED / 0.1) ** 2)),
    (
        "cold-lubricant-friction",
        {"power": 1.0, "no_drag_above_degC": 10.0, "reference_degC": -5.0},
        SPEED * np.maximum(10 - WARM, 0) / 15,
    ),
    (
        "cold-lubricant-friction",
        {"power": 0.0, "pole_degC": -95.0, "scale_K": 20.0, "reference_degC": -5.0},
        SIGN * np.exp(90 / 20 * (90 / (WARM + 95) - 1)),
    ),
    ("load-dependent-efficiency", {"power": 2.0, "reference_size": 3.0}, PREDICTED * RELATIVE**2),
    ("load-dependent-efficiency", {"light": 0.5, "reference_size": 3.0}, PREDICTED * np.exp(-RELATIVE / 0.5)),
    (
        "load-dependent-efficiency",
        {"bent": 0.2, "reference_size": 3.0},
        PREDICTED * (RELATIVE - 1) / (1 - 0.2 * (RELATIVE - 1)),
    ),
    (
        "torque-constant-temperature",
        {"reference_degC": 20.0, "bent_per_K": 0.002},
        PREDICTED * (WARM - 20) / (1 - 0.002 * (WARM - 20)),
    ),
    ("rotor-inertia", {"lag_s": 0.0}, P.covariates["wheel_acceleration"]),
    ("grade-resistance", {"shared": "evenly"}, np.sin(P.covariates["pitch"])),
    (
        "grade-resistance",
        {"shared": "by load", "reference_load": 40.0},
        np.sin(P.covariates["pitch"]) * LOAD / 40,
    ),
    ("slip-sinkage", {"power": 1.0}, PREDICTED * P.covariates["slip"]),
    ("slip-sinkage", {"step": 0.3}, 3 * PREDICTED),
    ("multi-pass-compaction", {"kept": 0.5, "leads": "front", "by": "current"}, PREDICTED * [0, 0, 1, 1]),
    (
        "multi-pass-compaction",
        {"kept": 0.0, "leads": "travel", "by": "stiffness"},
        PREDICTED * np.where(SIGN > 0, [0, 0, 1, 1], [1, 1, 0, 0]),
    ),
    (
        "soil-transition",
        {"onset_s": 20.0, "along": "time", "of": "strength"},
        PREDICTED * (TIME_S >= 20),
    ),
    (
        "soil-transition",
        {"onset_s": 20.0, "along": "place", "within_m": 0.5, "of": "cohesion"},
        2 * SIGN * np.clip(0.5 + (P.covariates["place"] - 2.0) / 0.5, 0, 1),
    ),
    ("current-sensor-bias", {}, np.ones(SPEED.shape)),
    ("bearing-drag", {"onset_s": 20.0, "rise_s": 0.0}, SIGN * (TIME_S >= 20)),
    ("bearing-drag", {"onset_s": 20.0, "rise_s": 8.0}, SIGN * (1 - np.exp(-np.maximum(TIME_S - 20, 0) / 8))),
    (
        "bearing-drag",
        {"onset_s": 20.0, "full_at_s": 70.0, "power": 0.5},
        SIGN * np.sqrt(np.maximum(TIME_S - 20, 0) / 50),
    ),
]


@pytest.mark.parametrize(("name", "shape", "law"), LAWS, ids=lambda value: value if isinstance(value, str) else "")
def test_a_column_is_its_law(name: str, shape: Shape, law: Array) -> None:
    """One column per law, with the coefficient 1."""
    (column,) = CANDIDATES[name].columns(P, shape)
    np.testing.assert_allclose(column, law, rtol=1e-9, atol=1e-12)


def test_a_predicted_load_s_drift_begins_at_its_onset_and_never_shrinks() -> None:
    """As creep does, quickly or slowly, or as a ramp that is 1 at the end of the recording."""
    drift = DriftOfPredictedLoad()
    ways = {tuple(key for key in shape if key != "onset_s") for shape in drift.shapes(P)}
    assert ways == {("rise_s",), ("full_at_s",)}
    for shape in drift.shapes(P):
        (column,) = drift.columns(P, shape)
        assert not column[float(shape["onset_s"]) > TIME_S].any()
        assert np.all(np.diff(column, axis=0) >= 0)
        assert 0 < column[-1, 0] <= 1
    rises = {float(shape["rise_s"]) for shape in drift.shapes(P) if "rise_s" in shape}
    assert sorted(rises) == pytest.approx([0.05 * P.length_s, 0.15 * P.length_s])


def shown(value: object) -> str:
    """Return a shape's value with six digits."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def test_the_grids_of_shapes_are_those_that_were_reviewed() -> None:
    """Each candidate's shapes and their penalties, in order: a change of a grid is seen in the difference."""
    lines = []
    for name, candidate in CANDIDATES.items():
        lines += [f"{name} of {candidate.shape_count(P):.6g} shapes"]
        for shape in candidate.shapes(P):
            values = " ".join(f"{key}={shown(value)}" for key, value in shape.items())
            lines.append(f"  {values} penalty {candidate.prior_penalty(P, shape):.6g}")
    assert_golden("\n".join(lines) + "\n", Path(__file__).with_name("golden") / "shapes.txt")


def test_turning_has_a_drag_and_a_moment_relative_to_the_reference_turn() -> None:
    """The reference turn has the size 1, twice that turn 4/3: the drag follows the rotation, the moment the side."""
    shape: Shape = {"half_at": 1.0, "ends": 0.0, "by": "rate", "reference_turn": 0.01}
    drag, moment = CANDIDATES["turning-resistance"].columns(P, shape)
    turns = (TIME_S > 30) * 4 / 3
    np.testing.assert_allclose(drag, turns * SIGN)
    np.testing.assert_allclose(moment, turns * np.array([-1.0, 1.0, -1.0, 1.0]))


def test_a_rut_that_changes_the_soil_has_a_column_for_each_property() -> None:
    """Stiffness, shear modulus and cohesion, on the wheels behind."""
    columns = CANDIDATES["multi-pass-compaction"].columns(P, {"kept": 0.0, "leads": "front", "by": "soil"})
    behind = np.array([0, 0, 1, 1])
    for column, law in zip(columns, (PREDICTED, 2 * PREDICTED, 2 * SIGN), strict=True):
        np.testing.assert_allclose(column, law * behind, rtol=1e-9, atol=1e-12)


def test_a_ripple_has_a_cosine_and_a_sine_for_each_wheel() -> None:
    """Each wheel has a phase of its own; the overtone has twice the order."""
    candidate = CANDIDATES["wheel-angle-ripple"]
    columns = candidate.columns(P, {"order": 3.0, "kind": "torque", "lag": 0.0, "sines": 2.0})
    assert columns.shape == (2 * WHEELS * 2, TIMES, WHEELS)
    angle = P.covariates["wheel_angle"]
    np.testing.assert_allclose(columns[2][:, 1], np.cos(3 * angle[:, 1]))
    np.testing.assert_allclose(columns[3][:, 1], np.sin(3 * angle[:, 1]))
    np.testing.assert_allclose(columns[2 * WHEELS + 2][:, 1], np.cos(6 * angle[:, 1]))
    assert not columns[2][:, [0, 2, 3]].any()
    found = candidate.parameters({"order": 3.0, "sines": 1.0}, [3.0, 4.0, 0.0, 5.0])
    assert found == {"amplitude": pytest.approx(5.0), "order": 3.0}


def test_a_load_cell_s_offset_takes_the_current_of_that_load_away() -> None:
    """With a prediction linear in the load, an offset of d mean readings changes it by −slope × d × mean load."""
    candidate = CANDIDATES["load-cell-drift"]
    first, second = (candidate.columns(P, {"relative_offset": offset})[0] for offset in (0.15, 0.35))
    np.testing.assert_allclose(second - first, -0.05 * SIGN * 0.2 * np.mean(LOAD, axis=0), rtol=1e-6)


def test_a_load_cell_s_drift_is_exact_where_the_simulation_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """At each offset of the grid, the first and the last included; between them a parabola is close to the curve."""
    monkeypatch.setattr(
        LoadCellDrift, "_simulated", lambda _, problem, offset: np.full(problem.mask.shape, np.exp(offset))
    )
    for offset in (*OFFSETS, 0.6, -0.3):
        (column,) = LoadCellDrift().columns(P, {"relative_offset": offset})
        np.testing.assert_allclose(column, np.exp(offset), rtol=1e-9 if offset in OFFSETS else 0.01)


def test_a_load_is_taken_relative_to_its_mean_and_a_cell_that_reads_zero_has_no_drift() -> None:
    """Another unit of the load changes nothing, and a dead cell divides nothing by zero."""
    load = LOAD.copy()
    load[:, 1], load[:, 3] = 0.0, LOAD[:, 3] / 1000
    dead = replace(P, covariates={**P.covariates, "load": load}, made={})
    left, before = LoadCellDrift()._unexplained_load(dead), LoadCellDrift()._unexplained_load(replace(P, made={}))
    assert not left[:, 1].any()
    np.testing.assert_allclose(left[:, [0, 2, 3]], before[:, [0, 2, 3]], atol=1e-12)
    assert np.std(before[:, 3]) > 1e-3


WARMEST_K = float(np.max(WARM)) - 20
BELOW, ABOVE = (float(end(np.abs(PREDICTED))) / 4.5 - 1 for end in (np.min, np.max))
AGREEING: list[tuple[str, Shape, str, dict[float, float]]] = [
    (
        "torque-constant-temperature",
        {"reference_degC": 20.0},
        "bent_per_K",
        {0.004: 0.004, -0.1: 0.0, 9.0: 2 / 3 / WARMEST_K},
    ),
    ("torque-constant-temperature", {"reference_degC": 90.0}, "bent_per_K", {0.004: 0.004, 9.0: 9.0}),
    (
        "load-dependent-efficiency",
        {"reference_size": 4.5},
        "bent",
        {0.3: 0.3, -0.3: -0.3, 9.0: 2 / 3 / ABOVE, -9.0: 2 / 3 / BELOW},
    ),
    ("sensor-delay", {"late": "current_A"}, "secant_s", {2.0: 2.0, 9.0: 6.0, 0.0: 0.05}),
    ("sensor-delay", {"late": "speed"}, "input_secant_s", {2.0: 2.0, 9.0: 6.0, -1.0: 0.05}),
]


@pytest.mark.parametrize(("name", "shape", "key", "found"), AGREEING, ids=lambda value: str(value)[:30])
def test_a_shape_follows_its_coefficient_until_both_agree(
    name: str, shape: Shape, key: str, found: dict[float, float]
) -> None:
    """To two per cent, within what the law allows; then it is the same shape, and the engine stops."""
    candidate = CANDIDATES[name]
    assert BELOW < 0 < ABOVE
    for value, expected in found.items():
        moved = candidate.self_consistent_shape(P, {**shape, key: 0.7}, [value])
        assert moved == {**shape, key: pytest.approx(expected)}
        if expected:
            near = {**shape, key: expected * 1.015}
            assert candidate.self_consistent_shape(P, near, [value]) is near
            assert candidate.self_consistent_shape(P, {**shape, key: expected * 0.97}, [value]) == moved
    other: Shape = {"power": 1.0, "reference_size": 3.0}
    assert CANDIDATES["load-dependent-efficiency"].self_consistent_shape(P, other, [0.5]) is other


def test_a_delay_is_longer_than_sampling_leaves_open() -> None:
    """A reading and a quarter at least; it is sought from half to twice the grid's, up to a tenth of the recording."""
    delay = CANDIDATES["sensor-delay"]
    shape: Shape = {"late": "current_A", "secant_s": 2.0}
    assert [delay.plausible(P, shape, [seconds]) for seconds in (0.62, 0.63, 3.0)] == [False, True, True]
    bounds = delay.bounds(P, shape)["secant_s"]
    assert bounds == pytest.approx((0.05, 6.0))
    assert delay.search_range(P, shape, "secant_s", bounds) == pytest.approx((1.0, 4.0))
    assert delay.search_range(P, {**shape, "secant_s": 0.08}, "secant_s", bounds) == pytest.approx((0.05, 0.16))
    assert delay.search_range(P, {**shape, "secant_s": 4.0}, "secant_s", bounds) == pytest.approx((2.0, 6.0))
    assert delay.parameters(shape, [1.5]) == {"delay_s": 2.0}, "1.5 / 2 is the share of the change that was recorded"
    assert delay.parameters({"late": "speed_rad_s", "input_secant_s": 2.0}, [1.5]) == {"delay_s": 2.0}


def beginning(whole: Problem, count: int) -> Problem:
    """Return the problem of the first instants alone."""
    recording = whole.recording
    channels = {name: values[:count] for name, values in recording.channels.items()}
    return replace(
        whole,
        recording=replace(recording, time_s=recording.time_s[:count], run=recording.run[:count], channels=channels),
        measured=whole.measured[:count],
        prediction=whole.prediction[:count],
        mask=whole.mask[:count],
        covariates={name: values[:count] for name, values in whole.covariates.items()},
        made={},
    )


@pytest.mark.parametrize(
    "candidate", [c for c in library() if c.name not in OF_ITS_OWN_RECORDING], ids=lambda candidate: candidate.name
)
def test_a_column_depends_on_its_own_instants_alone(candidate: Candidate) -> None:
    """With the shape given, what else was recorded changes nothing: the means of a recording are no part of a law."""
    whole = problem()
    part = beginning(whole, 90)
    for shape in [*candidate.shapes(whole), *candidate.propose_shapes(whole, whole.filled)]:
        of_part, of_whole = (candidate.columns(each, shape)[:, : 90 - EDGE] for each in (part, whole))
        np.testing.assert_allclose(of_part, of_whole, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("candidate", library(), ids=lambda c: c.name)
def test_shapes_lie_within_their_bounds_and_bounds_within_the_law(candidate: Candidate) -> None:
    """A free parameter of the grid is inside the bounds of this recording, up to their step; both are ordered."""
    for shape in candidate.shapes(P):
        for name, (low, high) in candidate.bounds(P, shape).items():
            assert low < high
            if name in shape:
                assert low - 1e-9 <= float(shape[name]) <= high + 1e-9
                assert candidate.free[name][0] <= candidate.free[name][1]


@pytest.mark.parametrize("candidate", [*library(), DriftOfPredictedLoad()], ids=lambda c: f"{c.name}-{c.channel}")
def test_every_key_of_a_shape_is_told_in_the_documentation(candidate: Candidate) -> None:
    """What stands in `[[effects]]` can be looked up, and nothing else is told."""
    shapes = [*candidate.shapes(P), *candidate.propose_shapes(P, P.filled), *candidate.onset_profiles(P)]
    keys = {key for shape in shapes for key in shape}
    assert keys <= set(candidate.shape_keys)
    assert set(candidate.free) <= set(candidate.shape_keys)


@pytest.mark.parametrize("candidate", library(), ids=lambda c: c.name)
def test_a_candidate_needs_what_it_requires(candidate: Candidate) -> None:
    """Without one of its covariates it is not looked for; with all of them it is."""
    assert candidate.applies(P)
    for name in candidate.requires:
        less = {key: values for key, values in P.covariates.items() if key != name}
        bare = Problem(P.recording, P.simulation, P.values, P.measured, PREDICTED, P.mask, less, P.side, P.row)
        assert not candidate.applies(bare)


@pytest.mark.parametrize("candidate", library(), ids=lambda c: c.name)
def test_a_candidate_has_enough_shapes_to_choose_from_and_profiles_without_an_onset(candidate: Candidate) -> None:
    """The penalty counts at least the grid; an onset's profile has no onset."""
    assert candidate.shape_count(P) >= max(len(candidate.shapes(P)), 1)
    assert all("onset_s" not in profile for profile in candidate.onset_profiles(P))
    assert candidate.label


def test_more_columns_than_coefficients_are_refused() -> None:
    """A wrong count is no answer without a name."""
    with pytest.raises(ValueError, match="zip"):
        CANDIDATES["coulomb-friction"].parameters({}, [1.0, 2.0])


def test_growth_is_a_step_a_rise_or_a_ramp() -> None:
    """0 before the onset; 1 from it on, 1 − 1/e after the time constant, or 1 where the ramp is full."""
    ways: list[Shape] = [{"rise_s": 0.0}, {"rise_s": 10.0}, {"full_at_s": 60.0}]
    step, rise, ramp = (growth(P, {"onset_s": 20.0, **way})[:, 0] for way in ways)
    at = {t: round(t / STEP_S) for t in (19.5, 20, 30, 40, 60)}
    assert [step[at[t]] for t in (19.5, 20, 60)] == [0, 1, 1]
    assert rise[at[30]] == pytest.approx(1 - np.exp(-1))
    assert [ramp[at[t]] for t in (19.5, 20, 40, 60)] == pytest.approx([0, 0, 0.5, 1])


def test_onsets_leave_both_ends_of_the_recording_out() -> None:
    """From 5 to 95 % of its length."""
    found = onset_grid(P, 5)
    assert found == pytest.approx([3.0, 16.5, 30.0, 43.5, 57.0])


def test_a_loss_is_against_the_motion_also_where_the_load_drives() -> None:
    """A share of the size, with the direction of motion, and none at standstill."""
    standing, lowered = P.covariates["direction"].copy(), SPEED.copy()
    standing[10:20] = 0.0
    driven = replace(P, covariates={**P.covariates, "direction": standing}, prediction=-np.abs(P.prediction))
    (column,) = CANDIDATES["load-dependent-efficiency"].columns(driven, {"power": 0.0, "reference_size": 1.0})
    np.testing.assert_allclose(column, np.abs(P.prediction) * np.where(standing == 0, 0.0, np.sign(lowered)))
