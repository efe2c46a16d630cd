"""Smooth terms against named effects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from linear_machine import equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch.regression.groups.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.regression.nuisance import Nuisance
from regolithd.calibration.mismatch.selection import smooth_terms
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_smooth_term
from regolithd.calibration.mismatch.selection.slow_noise import best_curve
from regolithd.calibration.mismatch.selection.smooth_terms import (
    drop_transients,
    drop_what_a_curve_explains,
    unexplained_beside,
    weigh_against_smooth_terms,
)

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations


def equations_with(added: object = 0.0, **effects: float) -> NormalEquations:
    """Return equations with smooth terms, of a recording to which something is added."""
    columns = table(**effects)  # type: ignore[arg-type]
    columns["reading_V"] = columns["reading_V"] + (added(columns) if callable(added) else added)
    equations = equations_of(problem_of(columns))
    return equations.over(with_smooth_terms(equations.design))


def bump(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Return a bump over the speed that no candidate has."""
    return np.asarray(0.6 * np.exp(-(((np.abs(columns["speed_rad_s"]) - 0.9) / 0.2) ** 2)))


def spell(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Return a drag that is there for a quarter of the time."""
    t_s = columns["t_s"]
    return np.asarray(0.5 * np.sign(columns["speed_rad_s"]) * ((t_s > 100) & (t_s < 200)))


def test_a_right_law_leaves_no_curve() -> None:
    """A named drag keeps its name, and nothing is unexplained."""
    equations = equations_with(drag=0.3)
    named = equations.fit([term_of(equations, "drag")])
    assert unexplained_beside(equations, named) is None
    kept, curves = weigh_against_smooth_terms(equations, named, (), 8.0)
    assert kept.terms == named.terms
    assert curves == ()


def test_what_no_candidate_explains_is_a_curve_over_its_covariate() -> None:
    """Without and beside a name."""
    for effects in ({}, {"drag": 0.4}):
        equations = equations_with(bump, **effects)
        named = equations.fit([term_of(equations, "drag")] if effects else [])
        kept, (curve,) = weigh_against_smooth_terms(equations, named, (), 8.0)
        assert curve.name == "wheel_speed"
        assert [term.name for term in kept.terms] == (["drag"] if effects else [])


def test_what_one_curve_explains_needs_no_names_of_other_covariates() -> None:
    """Two effects that only imitate a bump lose their names to it."""
    equations = equations_with(bump)
    imitators = equations.fit([term_of(equations, "power"), term_of(equations, "step", place=2)])
    kept, (curve,) = weigh_against_smooth_terms(equations, imitators, (), 8.0)
    assert curve.name == "wheel_speed"
    assert "step" not in {term.name for term in kept.terms}


def test_a_curve_that_effects_imitate_goes_before_what_they_leave(monkeypatch: pytest.MonkeyPatch) -> None:
    """Even where the effects score better with a further curve than the curve does with what is left of them."""
    equations = equations_with(bump, drag=0.4)
    named = equations.fit([term_of(equations, "drag")])
    monkeypatch.setattr(smooth_terms, "_is_behind_a_curve", lambda *_: True)
    monkeypatch.setattr(smooth_terms, "law_misfit", lambda *_: 1.0)
    monkeypatch.setattr(smooth_terms, "_effects_beside_curve", lambda equations, *_: equations.fit(()))
    kept, curves = weigh_against_smooth_terms(equations, named, (), 8.0)
    assert kept.terms == ()
    assert curves == (best_curve(equations, (), best_of_each_smooth_term(equations, ())),)


def test_a_change_that_comes_and_goes_loses_its_name() -> None:
    """A step that is taken back is none; one that stays keeps its name."""
    passing = equations_with(spell)
    named = passing.fit([term_of(passing, "step", place=2)])
    assert drop_transients(passing, named).terms == ()
    staying = equations_with(lambda columns: 0.5 * np.sign(columns["speed_rad_s"]) * 0 + (columns["t_s"] > 120) * 0.4)
    named = staying.fit([term_of(staying, "step", place=2)])
    assert drop_transients(staying, named) is named


def test_a_small_name_beside_a_large_curve_is_dropped() -> None:
    """It is kept where it gains a tenth of what the curve gains."""
    equations = equations_with(bump, drag=0.02)
    curve = unexplained_beside(equations, equations.fit(()))
    assert curve is not None
    small = equations.fit([term_of(equations, "drag")])
    assert drop_what_a_curve_explains(equations, small, curve).terms == ()
    large = equations_with(bump, drag=0.5)
    fit = large.fit([term_of(large, "drag")])
    curve = best_of_each_smooth_term(large, fit.terms)[0][1]
    assert drop_what_a_curve_explains(large, fit, curve).terms == fit.terms


@pytest.mark.parametrize("seed", [0, 1])
def test_noise_has_no_curve(seed: int) -> None:
    """Nothing is unexplained where nothing is missing."""
    equations = equations_with(seed=seed)
    assert weigh_against_smooth_terms(equations, equations.fit(()), (), 8.0)[1] == ()


def test_a_name_of_the_curves_own_covariate_is_part_of_the_unknown() -> None:
    """However much it gains beside the curve; a name of another covariate that gains as much is kept."""
    equations = equations_with(lambda columns: bump(columns) + 0.4 * np.abs(columns["speed_rad_s"]), drag=0.4)
    curve = next(term for _, term in best_of_each_smooth_term(equations, ()) if term.name == "wheel_speed")
    named = equations.fit([term_of(equations, "power"), term_of(equations, "drag")])
    assert {term.name for term in drop_what_a_curve_explains(equations, named, curve).terms} == {"drag"}


def test_a_curve_that_explains_far_more_than_one_name_takes_its_place() -> None:
    """A drag that is there for a while is no drag, though beside the drag no curve is significant."""
    equations = equations_with(spell)
    named = equations.fit([term_of(equations, "drag")])
    kept, (curve,) = weigh_against_smooth_terms(equations, named, (), 8.0)
    assert kept.terms == ()
    assert curve.name == "time"


def test_beside_a_parameter_that_leaves_its_prior_no_misfit_is_tolerated(monkeypatch: pytest.MonkeyPatch) -> None:
    """A curve of a tenth of a name's gain is a law's misfit, unless a parameter has to pay for it."""
    equations = equations_with(lambda columns: 0.25 * bump(columns), drag=0.6)
    named = equations.fit([term_of(equations, "drag")])
    assert unexplained_beside(equations, named) is None
    monkeypatch.setattr(Nuisance, "leaving_their_priors", lambda *_: np.array([0]))
    left = unexplained_beside(equations, named)
    assert left is not None
    assert left.name == "wheel_speed"


def test_a_parameter_leaves_its_prior_beyond_three_deviations() -> None:
    """The level is stated as 2.0 with a deviation of 0.5."""
    for shift, leaving in ((1.3, 0), (1.7, 1)):
        equations = equations_with(shift)
        found = equations.nuisance.leaving_their_priors(equations.fit(()), equations.problem)
        assert len(found) == leaving


def test_what_a_refuted_name_leaves_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """A change that does not stay loses its name; what it explained is told, though no curve would enter alone."""
    equations = equations_with(spell)
    onset = term_of(equations, "step", place=2)
    named = equations.fit([onset])
    monkeypatch.setattr(smooth_terms, "drop_transients", lambda equations, _: equations.fit(()))
    monkeypatch.setattr(smooth_terms, "unexplained_beside", lambda *_: None)
    kept, curves = weigh_against_smooth_terms(equations, named, (), 1.0)
    assert kept.terms == ()
    assert [(curve.name, curve.wheels) for curve in curves] == [("time", onset.wheels)]
