"""The noise of a residual that holds effects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from lifting_axis import LiftingAxis, drive
from linear_machine import NOISE, equations_of, problem_of, table

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.selection import noise_estimation
from regolithd.calibration.mismatch.selection.noise_estimation import fit_of_significant_terms
from regolithd.calibration.mismatch.signal.noise_models.noise import estimate_noise

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.group import Term


def test_an_effect_does_not_count_as_noise() -> None:
    """With a large drag in the residual the noise is what it is without."""
    equations = equations_of(problem_of(table(drag=0.6)))
    mask = equations.problem.mask
    naive = estimate_noise(residual_of(equations, equations.fit(())), mask)
    significant = fit_of_significant_terms(equations)
    noise = estimate_noise(residual_of(equations, significant), equations.problem.mask)
    np.testing.assert_allclose(noise.deviation, NOISE, rtol=0.05)
    assert noise.autocorrelation_time == pytest.approx(1.0, abs=0.3)
    assert naive.autocorrelation_time > 5
    assert residual_of(equations, significant).std() == pytest.approx(NOISE, rel=0.05)


def test_what_slow_noise_explains_gives_its_place_to_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the most significant term is refused, the next law of the same residual is taken out of the noise."""
    equations = equations_of(problem_of(table(drag=0.6)))
    asked: list[str] = []

    def refuses_the_first(_equations: object, _rest: object, terms: Sequence[Term]) -> float:
        asked.append(terms[0].name)
        return -1.0 if terms[0].name == asked[0] else 1.0

    monkeypatch.setattr(noise_estimation, "score_beside_slow_noise", refuses_the_first)
    terms = fit_of_significant_terms(equations).terms
    assert terms
    assert asked[0] not in {term.name for term in terms}


def test_without_candidates_it_is_the_noise_of_the_residual() -> None:
    """Nothing can be taken out."""
    equations = equations_of(problem_of(table()), ())
    significant = fit_of_significant_terms(equations)
    noise = estimate_noise(residual_of(equations, significant), equations.problem.mask)
    direct = estimate_noise(residual_of(equations, equations.fit(())), equations.problem.mask)
    assert noise.autocorrelation_time == direct.autocorrelation_time
    np.testing.assert_allclose(noise.deviation, direct.deviation, rtol=1e-6)
    assert significant.terms == ()


@pytest.mark.parametrize("noise_time_s", [2.0, 5.0])
def test_noise_that_wanders_for_seconds_is_no_finding(noise_time_s: float) -> None:
    """Of six recordings without any effect at most one is told as unexplained, and nothing is named."""
    answers = [compare(drive(seed, noise_time_s=noise_time_s), LiftingAxis()).answer for seed in range(6)]
    assert not any(answer.effects for answer in answers)
    assert sum(answer.verdict == "consistent" for answer in answers) >= 5
