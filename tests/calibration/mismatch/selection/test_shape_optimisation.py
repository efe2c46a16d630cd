"""Optimisation of a shape parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import AXES, INSTANTS, STEP_S, Drag, Power, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch.candidates.bearing_drag import BearingDrag
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.selection.shape_optimisation import (
    maximise,
    optimised_shape,
    peak_within,
    shape_profile,
    with_best_developments,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from regolithd.calibration.mismatch import Problem


@pytest.mark.parametrize("top", [0.0, 0.31, 1.7, 4.0])
def test_a_maximum_is_found_wherever_it_is(top: float) -> None:
    """At the ends too."""
    at, value = maximise(lambda x: 3 - (x - top) ** 2, 0.0, 4.0)
    assert at == pytest.approx(top, abs=2e-3)
    assert value == pytest.approx(3, abs=1e-5)


def test_the_higher_of_two_maxima_is_found() -> None:
    """The scan decides where to narrow."""
    at, _ = maximise(lambda x: np.exp(-((x - 1) ** 2)) + 2 * np.exp(-((x - 5) ** 2)), 0.0, 6.0)
    assert at == pytest.approx(5.0, abs=0.01)


@pytest.mark.parametrize(
    ("function", "most"),
    [
        (lambda x: -((x - 0.6) ** 2), 3),
        (lambda x: 1 / (1 + (x - 0.6) ** 2), 6),
        (lambda x: -abs(x - 0.6), 14),
        (lambda x: -((x - 0.6) ** 4) if x < 0.8 else -float("inf"), 16),
        (lambda x: x, 1),
        (lambda _: 0.0, 14),
    ],
    ids=["parabola", "smooth", "kink", "flat top beside no value", "at the end", "level"],
)
def test_a_peak_is_narrowed_down_in_few_steps(function: Callable[[float], float], most: int) -> None:
    """To a thousandth of the interval; golden sections alone take fourteen for each."""
    asked: list[float] = []

    def counted(x: float) -> float:
        asked.append(x)
        return function(x)

    start = [(x, function(x)) for x in ((0.0, 0.5, 1.0) if function(1.0) < function(0.5) else (0.5, 1.0, 1.0))]
    at, value = peak_within(counted, *start)
    assert value == function(at)
    assert value >= max(map(function, np.linspace(0, 1, 101))) - 2e-3
    assert all(0 <= x <= 1 for x in asked)
    assert len(asked) <= most


def test_the_profile_is_the_gain_beside_the_other_terms() -> None:
    """As the equations have it for a column of the grid, on one axis as on two."""
    equations = equations_of(problem_of(table(drag=0.3, factor=0.2)))
    others = [term_of(equations, "drag")]
    for wheels in ((0, 1), (1,)):
        profile = shape_profile(equations, others, Power(), wheels)
        for place in (0, 1):
            term = term_of(equations, "power", wheels, place)
            gain = equations.fit([*others, term]).delta_chi2 - equations.fit(others).delta_chi2
            assert profile(term.group.shape) == pytest.approx(gain, rel=5e-3, abs=0.05)
            assert profile.along(term.group.shape, "power")(float(term.group.shape["power"])) == profile(
                term.group.shape
            )


def test_the_profile_of_a_wrong_sign_is_zero() -> None:
    """What pushes is no drag."""
    equations = equations_of(problem_of(table(drag=-0.3)))
    assert shape_profile(equations, (), Drag(), (0, 1))({}) == 0


def test_what_has_no_free_shape_stays_as_it_is() -> None:
    """No column is added."""
    equations = equations_of(problem_of(table(drag=0.3)))
    extended, term = optimised_shape(equations, (), term_of(equations, "drag"))
    assert extended is equations
    assert term == term_of(equations, "drag")


class SelfConsistent(Drag):
    """A drag whose shape holds its own coefficient, as a law does that is not linear in it."""

    name = "self-consistent"

    def shapes(self, problem: object) -> list[dict[str, float | str]]:  # noqa: ARG002
        """Return no bend at first."""
        return [{"bent": 0.0}]

    def self_consistent_shape(self, problem: object, shape: object, values: object) -> dict[str, float | str]:  # noqa: ARG002
        """Return the coefficient, rounded, so that it settles."""
        return {"bent": round(values[0], 1)}  # type: ignore[index]


def test_a_shape_is_made_to_agree_with_its_coefficients() -> None:
    """The drag of 0.3 becomes a part of its shape."""
    equations = equations_of(problem_of(table(drag=0.3)), (SelfConsistent(),))
    extended, term = optimised_shape(equations, (), term_of(equations, "self-consistent"))
    assert term.group.shape == {"bent": 0.3}
    assert extended.design.size == equations.design.size + 1


class Saturating(SelfConsistent):
    """A drag that grows with the square root of its size: half of the way is left after each fit."""

    name = "saturating"

    def shapes(self, problem: object) -> list[dict[str, float | str]]:  # noqa: ARG002
        """Return a size far from the true one."""
        return [{"bent": 1.0}]

    def self_consistent_shape(self, problem: object, shape: object, values: object) -> dict[str, float | str]:  # noqa: ARG002
        """Return the coefficient."""
        return {"bent": values[0]}  # type: ignore[index]

    def columns(self, problem: Problem, shape: Mapping[str, float | str]) -> np.ndarray:
        """Return a drag of 1 where the shape is of that size."""
        return super().columns(problem, {}) / np.sqrt(float(shape["bent"]))


def test_few_fits_lead_to_a_shape_that_agrees() -> None:
    """The fourth is extrapolated from those before: 0.3 is the root of 0.09."""
    equations = equations_of(problem_of(table(drag=0.3)), (Saturating(),))
    _, term = optimised_shape(equations, (), term_of(equations, "saturating"))
    assert term.group.shape["bent"] == pytest.approx(0.09, rel=0.03)


class Bend(Power):
    """A power of the speed that is 1 or 2 unless a recording demands another."""

    name = "bend"
    free: ClassVar = {}
    refined: ClassVar = {"power": (0.5, 3.0)}


@pytest.mark.parametrize(("factor", "power", "moves"), [(0.8, 1.5, True), (0.8, 2.0, False), (0.15, 1.9, False)])
def test_a_usual_number_is_left_where_a_recording_demands_it(factor: float, power: float, *, moves: bool) -> None:
    """A number that is no usual one is charged what it had to gain, and has an interval."""
    equations = equations_of(problem_of(table(factor=factor, power=power)), (Bend(),))
    best = max((term_of(equations, "bend", place=k) for k in (0, 1)), key=lambda term: equations.fit([term]).delta_chi2)
    extended, term = optimised_shape(equations, (), best)
    problem, limits = equations.problem, equations.thresholds
    assert (term.group.shape != best.group.shape) is moves
    assert set(Bend().unusual(problem, term.group.shape)) == ({"power"} if moves else set())
    assert term.group.selection_penalty - best.group.selection_penalty == (limits.lead_margin if moves else 0.0)
    if moves:
        assert float(term.group.shape["power"]) == pytest.approx(power, abs=0.1)
        gained = extended.fit([term]).delta_chi2 - equations.fit([best]).delta_chi2
        assert gained > limits.lead_margin


def test_an_onset_is_sought_near_its_place_in_the_grid() -> None:
    """From the nearest of nine onsets to within two seconds of 231 s."""
    columns = table(noise=0.1)
    columns["reading_V"] = columns["reading_V"] + 0.5 * (columns["t_s"] >= 231)
    equations = equations_of(problem_of(columns))
    nearest = max(range(9), key=lambda k: equations.fit([term_of(equations, "step", place=k)]).delta_chi2)
    _, term = optimised_shape(equations, (), term_of(equations, "step", place=nearest))
    assert float(term.group.shape["onset_s"]) == pytest.approx(231, abs=2)
    assert isinstance(term, Term)


def test_a_step_is_found_though_a_rise_is_ahead_of_it_on_the_grid() -> None:
    """Its onset is half way between two of the grid, where a rise that begins earlier follows it closer."""
    onset_s = 183.0
    late = np.broadcast_to((np.arange(INSTANTS) * STEP_S >= onset_s)[:, None] * [0.0, 1.0], (INSTANTS, AXES))
    equations = equations_of(problem_of(table(drag=2.0 * late)), (BearingDrag(),))
    groups = [group for group in equations.design.groups if 0 < group.shape.get("rise_s", 0.0) < 20.0]
    gains = equations.further((), groups)
    _, rise = max(((gain, term) for gain, term in gains if term.wheels == (1,)), key=lambda pair: pair[0])
    equations, rise = optimised_shape(equations, (), rise)
    before = equations.fit((rise,))
    equations, (step,) = with_best_developments(equations, (rise,))
    assert step.group.shape["rise_s"] == 0.0
    assert step.group.shape["onset_s"] == pytest.approx(onset_s, abs=STEP_S)
    assert equations.score(equations.fit((step,))) > equations.score(before) + 20
