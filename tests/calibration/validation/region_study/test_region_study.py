"""The study of laws that fail in regions: its cases, LISDD and the scores."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.answer import Parameter, Range, Unexplained
from regolithd.calibration.validation.lisdd import lisdd
from regolithd.calibration.validation.region_study.__main__ import bias, figures_of, table
from regolithd.calibration.validation.region_study.machines import MACHINES, Case, Group, Machine, Stated, case_of
from regolithd.calibration.validation.region_study.picture import picture
from regolithd.calibration.validation.region_study.score import METHODS, Score, rows_of, scores_of


@pytest.mark.parametrize(("machine", "group"), [*product(MACHINES, ("one", "two"))])
def test_outside_of_its_regions_a_case_is_the_law_and_noise(machine: Machine, group: Group) -> None:
    """And inside it is not: the residual's power there is larger."""
    case = case_of(machine, 3, group, correlated=False)
    left = case.recorded[machine.channel] - sum(
        case.true[name] * tangent for name, tangent in machine.tangents(case.recorded).items()
    )
    assert np.std(left[~case.failing]) == pytest.approx(machine.noise, rel=0.1)
    assert np.mean(left[case.failing] ** 2) > 1.5 * machine.noise**2
    assert len(case.bounds) == {"one": 1, "two": 2}[group]


def peer_on(case: Case) -> tuple[np.ndarray, float]:
    """Return the rows that LISDD flags, and its largest relative error of a parameter."""
    tangents = np.column_stack(list(case.machine.tangents(case.recorded).values()))
    covariates = {name: case.recorded[column] for name, column in case.machine.covariates.items()}
    found = lisdd(tangents, case.recorded[case.machine.channel], covariates)
    true = np.array(list(case.true.values()))
    return found.failing, float(np.max(np.abs(found.parameters / true - 1)))


def test_lisdd_finds_a_region_and_the_parameters_outside_of_it() -> None:
    """In white noise, as it assumes."""
    case = case_of(MACHINES[0], 0, "one", correlated=False)
    failing, error = peer_on(case)
    both = np.sum(failing & case.failing)
    assert 2 * both / (failing.sum() + case.failing.sum()) > 0.7
    assert error < 0.03


def test_lisdd_flags_nothing_in_white_noise() -> None:
    """Where the law holds."""
    failing, _ = peer_on(case_of(MACHINES[2], 0, "none", correlated=False))
    assert not failing.any()


def test_the_engine_tells_the_region_and_is_not_biased_by_it() -> None:
    """More rows are right than with LISDD's bins, and the parameters are as if the regions were known."""
    scores = {score.method: score for score in scores_of(case_of(MACHINES[2], 1, "two", correlated=True))}
    assert scores["regolithd"].f1 > 0.9
    assert max(map(abs, scores["regolithd"].errors)) < 0.03
    assert max(map(abs, scores["no discrepancy"].errors)) > 0.03
    assert scores["regions known"].f1 == 1.0


def score(method: str, error: float, *, f1: float = 0.5, group: str = "one") -> Score:
    """Return a score."""
    return Score(method, "pump", group, correlated=False, f1=f1, told=True, errors=(error, 0.02), bounds_held=(1, 2))


def test_a_range_may_be_of_the_size_of_the_prediction() -> None:
    """Which is no recorded column: it is what the machine's law predicts."""
    case = case_of(MACHINES[1], 1, "none", correlated=False)
    beyond = Range("power", Parameter(450.0, 440.0, 460.0, "W"), None, "beyond 450 W")
    rest = Unexplained("power_W", (1,), "power", 0.0, 60.0, 0.2, range=beyond)
    answer = replace(compare(case.recorded, Stated(case.machine)).answer, effects=(), unexplained=(rest,))
    predicted = Stated(case.machine).predict(case.recorded, case.true)
    assert np.array_equal(rows_of(answer, case), np.abs(predicted) >= 450.0)
    assert 0 < rows_of(answer, case).sum() < len(predicted)


def test_bias_is_of_the_mean_and_not_of_single_errors() -> None:
    """Errors of either sign cancel, parameter by parameter."""
    assert bias([score("LISDD", 0.1), score("LISDD", -0.1)]) == pytest.approx(0.01)


def test_figures_table_and_picture_have_every_method() -> None:
    """From the cases of one and of two regions; false regions from those without."""
    scores = [score(method, 0.1, group=group) for method in METHODS for group in ("none", "everywhere", "one", "two")]
    figures = figures_of(scores)
    assert figures["LISDD_f1"] == 0.5
    assert figures["regolithd_false_regions"] == 1
    assert figures["bounds"] == 2 * 2 * len(METHODS)
    white = [each for each in scores if each.group in {"one", "two"}]
    assert picture(white).count('class="dot"') == 2 * 2
    assert (
        len(table(scores + [s for each in scores for s in [each.__class__(**{**vars(each), "correlated": True})]]).rows)
        == 16
    )
