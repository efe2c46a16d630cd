"""What an answer says of each row and of each parameter, and how good that is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.problem.covariates import names_of_prediction
from regolithd.calibration.mismatch.regression.groups.smooth_groups import as_followed
from regolithd.calibration.validation.lisdd import lisdd
from regolithd.calibration.validation.region_study.machines import Array, Case, Mask, Stated

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.answer import Answer


METHODS = ("regolithd", "LISDD", "no discrepancy", "regions known")
"""The engine; LISDD; the physics fitted to all rows; and to the rows outside of the true regions."""


@dataclass(frozen=True)
class Score:
    """One method on one case.

    Attributes
    ----------
    f1: of the rows that are said to be in a failing region; NaN where there is none and none is said
    told: whether a range, or a flagged region, was told
    errors: relative, of each parameter
    bounds_held: bounds of true regions inside their 90 % intervals, and how many were compared
    """

    method: str
    machine: str
    group: str
    correlated: bool
    f1: float
    told: bool
    errors: tuple[float, ...]
    bounds_held: tuple[int, int] = (0, 0)


def scores_of(case: Case) -> tuple[Score, ...]:
    """Return the scores of the engine, of LISDD, of the physics fitted everywhere, and of the true regions known."""
    machine, recorded = case.machine, case.recorded
    tangents = np.column_stack(list(machine.tangents(recorded).values()))
    reading = recorded[machine.channel]
    covariates = {name: recorded[column] for name, column in machine.covariates.items()}
    answer = compare(recorded, Stated(machine)).answer
    values = {parameter.name: parameter.value for parameter in answer.parameters}
    engine = np.array([values[name] for name in machine.parameters])
    peer = lisdd(tangents, reading, covariates)
    everywhere, known = (
        np.asarray(np.linalg.lstsq(tangents[rows], reading[rows], rcond=None)[0], np.float64)
        for rows in (np.ones_like(case.failing), ~case.failing)
    )
    none = np.zeros(len(reading), np.bool_)
    return (
        _score("regolithd", case, rows_of(answer, case), engine, held_of(answer, case)),
        _score("LISDD", case, peer.failing, peer.parameters),
        _score("no discrepancy", case, none, everywhere),
        _score("regions known", case, case.failing, known),
    )


def rows_of(answer: Answer, case: Case) -> Mask:
    """Return the rows in which an answer says that the law fails: those of its ranges, all where it gives none."""
    failing = np.zeros(len(case.failing), np.bool_)
    for place in answer.unexplained:
        if place.range is None:
            return ~np.zeros_like(failing)
        values = _values(case, place.range.covariate)
        lower, upper = place.range.lower, place.range.upper
        failing |= (values >= (lower.value if lower else -np.inf)) & (values < (upper.value if upper else np.inf))
    return ~np.zeros_like(failing) if answer.effects else failing


def held_of(answer: Answer, case: Case) -> tuple[int, int]:
    """Return how many bounds of ranges hold a true bound of their covariate in their intervals, and of how many."""
    held = of = 0
    for place in answer.unexplained:
        for bound in (place.range.lower, place.range.upper) if place.range else ():
            true = case.bounds.get(place.covariate, ())
            if bound is not None and true:
                of += 1
                held += any(bound.low <= each <= bound.high for each in true)
    return held, of


def _values(case: Case, covariate: str) -> Array:
    """Return a covariate of each row: a recorded one, the time, or the size of what the machine's law predicts."""
    if covariate == "time":
        return case.recorded["t_s"]
    if covariate in names_of_prediction(case.machine.channel):
        return np.abs(Stated(case.machine).predict(case.recorded, case.true))
    return as_followed(covariate, case.recorded[case.machine.covariates[covariate]])


def _score(method: str, case: Case, failing: Mask, parameters: Array, held: tuple[int, int] = (0, 0)) -> Score:
    both, either = float(np.sum(failing & case.failing)), float(np.sum(failing) + np.sum(case.failing))
    true = np.array(list(case.true.values()))
    return Score(
        method=method,
        machine=case.machine.name,
        group=case.group,
        correlated=case.correlated,
        told=bool(failing.any() and not failing.all()),
        f1=2 * both / either if either else float("nan"),
        errors=tuple(((parameters - true) / true).tolist()),
        bounds_held=held,
    )
