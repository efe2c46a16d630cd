"""Held-out errors: what neither chose nor fitted an effect."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from linear_machine import CANDIDATES, NOISE, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch import Candidate, Coefficient, Problem, Shape
from regolithd.calibration.mismatch.inference import held_out
from regolithd.calibration.mismatch.inference.held_out import HeldOutErrors, chosen_effects, held_out_errors
from regolithd.calibration.mismatch.selection.best_subsets import optimised_shapes


def test_errors_fall_from_the_effect_to_the_noise() -> None:
    """Without the drag the error is the noise and the drag together, with it the noise."""
    equations = equations_of(problem_of(table(drag=0.4)))
    named = equations.fit([term_of(equations, "drag")])
    _, found = held_out_errors(equations, named, equations.design.groups, 8.0)
    assert found.after == pytest.approx(NOISE, rel=0.05)
    assert found.before == pytest.approx(np.hypot(NOISE, 0.4), rel=0.1)
    assert found.without == pytest.approx((found.before,))
    assert found.with_it == pytest.approx((found.after,))


def test_an_effect_on_one_axis_is_measured_there() -> None:
    """The other axis has no part in its errors."""
    columns = table()
    columns["reading_V"] = columns["reading_V"] + 0.4 * np.sign(columns["speed_rad_s"]) * (columns["axis"] == 2)
    equations = equations_of(problem_of(columns))
    named = equations.fit([term_of(equations, "drag", (1,))])
    _, found = held_out_errors(equations, named, equations.design.groups, 8.0)
    assert found.without[0] == pytest.approx(np.hypot(NOISE, 0.4), rel=0.1)
    assert found.without[0] > found.before > found.after


def test_a_fold_may_take_the_answers_effect_where_its_optimised_shape_scores_more() -> None:
    """A power of 1.5, between the grid's, loses to a rival on the grid, and beats it once it is optimised."""

    class Rival(Candidate):
        """A law of the speed that is nearer to the truth than the grid's powers."""

        name, covariate, equation, words, signature = "rival", "wheel_speed", "ΔV = r |ω|^1.45", "a rival", "a curve"
        experiment, source = "drive fast and slowly", "test"
        coefficients: ClassVar = (Coefficient("factor", "{unit}"),)

        def columns(self, problem: Problem, shape: Shape) -> np.ndarray:  # noqa: ARG002
            """Return |ω|^1.45."""
            return np.abs(problem.covariates["wheel_speed"])[None] ** 1.45

    recorded = table(factor=3.0, power=1.5, noise=0.05)
    equations = equations_of(problem_of(recorded), (*CANDIDATES, Rival()))
    grid = equations.design.groups
    assert {term.name for term in chosen_effects(equations, 1e3)} == {"rival"}
    equations, terms = optimised_shapes(equations, (term_of(equations, "power"),))
    _, found = held_out_errors(equations, equations.fit(terms), grid, 1e3)
    assert found.after < 0.2 * found.before


def test_without_effects_before_and_after_are_the_same() -> None:
    """Noise chooses nothing on any fold."""
    equations = equations_of(problem_of(table()))
    _, found = held_out_errors(equations, equations.fit(()), equations.design.groups, 8.0)
    assert found.before == found.after
    assert found.without == found.with_it == ()


def test_only_the_groups_that_are_given_are_chosen_from() -> None:
    """A group that data made later is not offered to the folds."""
    equations = equations_of(problem_of(table(drag=0.4, factor=0.2)))
    assert {term.name for term in chosen_effects(equations, 8.0)} == {"drag", "power"}
    without = [group for group in equations.design.groups if group.name != "drag"]
    assert "drag" not in {term.name for term in chosen_effects(equations.with_groups(without), 8.0)}
    assert chosen_effects(equations, 1e6) == ()


def test_three_effects_at_once_are_chosen() -> None:
    """A drag, a curve over the speed and a step."""
    columns = table(drag=0.4, factor=0.3)
    columns["reading_V"] = columns["reading_V"] + 0.5 * (columns["t_s"] >= 200)
    found = chosen_effects(equations_of(problem_of(columns)), 8.0)
    assert {term.name for term in found} == {"drag", "power", "step"}


def test_beside_one_effect_pairs_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """The three best alone; then three beside it, and two beside each of the six best; three effects at most."""
    tried: list[tuple[str, ...]] = []

    def fit(terms: tuple[str, ...]) -> SimpleNamespace:
        tried.append(tuple(terms))
        return SimpleNamespace(terms=tuple(terms))

    train: Any = SimpleNamespace(fit=fit, score=lambda found: len(found.terms))
    monkeypatch.setattr(
        held_out, "best_of_each_candidate", lambda _, terms: [(1.0, f"{len(terms)}{k}") for k in range(9)]
    )
    monkeypatch.setattr(held_out, "acceptable", lambda *_: True)
    monkeypatch.setattr(held_out, "passes_entry_test", lambda *_: True)
    assert chosen_effects(train, 8.0) == ("00", "10", "20")
    alone = [("00",), ("01",), ("02",)]
    beside = [("00", f"1{k}") for k in range(3)]
    pairs = [(f"0{one}", f"1{other}") for one in range(6) for other in range(2)]
    third = [("00", "10", f"2{k}") for k in range(3)]
    assert [each for each in tried if each] == [*alone, *beside, *pairs, ("00",), *third, ("00", "10")]


def test_two_answers_that_are_ahead_of_each_other_end_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is likelier beside the curves of the other, and lowers the held-out error by less and less: the second."""
    answers = {name: SimpleNamespace(names=frozenset({name}), refused=frozenset()) for name in ("one", "other")}
    errors = iter(SimpleNamespace(after=1.0, whole=1.0 / asked, without_gain=lambda: None) for asked in range(1, 9))
    monkeypatch.setattr(held_out, "groups_to_choose_from", lambda *_: [])
    monkeypatch.setattr(held_out, "names_of", lambda decision: decision.names)
    monkeypatch.setattr(held_out, "_errors_beside_curves", lambda decision, _: (decision, next(errors)))
    monkeypatch.setattr(
        held_out, "likelier_names", lambda decision: answers["one" if decision is answers["other"] else "other"]
    )
    first: Any = answers["one"]
    found, _ = held_out.confirmed_beside_curves(first, ())
    assert found is answers["other"]


def test_effects_that_cancel_each_other_gain_nothing_together() -> None:
    """Each lowers the error that the other makes: the one that lowers it less is the next to go."""
    together = HeldOutErrors(before=1.0, after=1.0, without=(1.3, 1.2), with_it=(1.0, 1.0), whole=1.0)
    assert together.without_gain() == 1
    assert replace(together, after=0.9).without_gain() is None
