"""The laws that a monitored recording is searched for: each candidate in one shape, as it acts once it has begun.

A change point in a candidate's shape (`onset_s`) is set before the recording: when a law begins is the test's own
business. A candidate that always begins (a failing bearing) is not tested from the start of the recording; one with the
same column that does not (Coulomb friction) is not tested from later on, where the other may be: one column, one name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import columns_of
from regolithd.calibration.mismatch.problem.words import in_units

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BEFORE_S = -1.0
"""An onset before the recording."""
SAME_COLUMN = 1e-9
"""Relative difference of two columns that are the same but for rounding."""
GROWING, PLACED = frozenset({"full_at_s"}), frozenset({"within_m"})
"""Parts of a shape that count from a time or a place of the whole recording: not known while it grows."""


@dataclass(frozen=True, eq=False)
class Law:
    """One column of a candidate in one shape.

    Attributes
    ----------
    part: which of the candidate's columns
    begins: whether the candidate always begins after the start
    parameter, unit: of the column's coefficient
    sign: that physics allows, 0 for either
    """

    candidate: Candidate
    shape: Shape
    part: int
    begins: bool
    parameter: str
    unit: str
    sign: int

    @property
    def name(self) -> str:
        """The candidate's."""
        return self.candidate.name


def laws_of(problem: Problem, candidates: Sequence[Candidate]) -> tuple[Law, ...]:
    """Return the laws that the beginning of a recording allows, each column once."""
    found: list[Law] = []
    for candidate in candidates:
        shape = _one_shape(problem, candidate)
        if shape is not None:
            parts = range(len(columns_of(problem, candidate, shape)))
            found += [_law(problem, candidate, shape, part) for part in parts]
    return tuple(found)


def _law(problem: Problem, candidate: Candidate, shape: Shape, part: int) -> Law:
    declared = candidate.coefficients
    coefficient = declared[min(part, len(declared) - 1)]
    return Law(
        candidate,
        shape,
        part,
        begins=candidate.change_point in shape,
        parameter=coefficient.name,
        unit=in_units(coefficient.unit, problem.simulation.unit, problem.labels),
        sign=coefficient.sign if part < len(declared) else 0,
    )


def _one_shape(problem: Problem, candidate: Candidate) -> Shape | None:
    """Return the middle of a candidate's grid, of a change point the step; None: it cannot be monitored.

    The wander of another channel is known from the whole recording alone.
    """
    if candidate.channel is not None or not candidate.applies(problem):
        return None
    shapes = [each for each in candidate.shapes(problem) if not set(each) & (GROWING | PLACED)]
    steps = [each for each in shapes if not each.get("rise_s")]
    if not steps:
        return None
    point = candidate.change_point
    return {**steps[0], point: BEFORE_S} if point in steps[0] else steps[len(steps) // 2]


def law_columns(problem: Problem, laws: Sequence[Law]) -> Array:
    """Return each law's column, shape (law, time, wheel), 0 where nothing is compared or its covariate is blank."""
    made: dict[str, Array] = {}
    for law in laws:
        if law.name not in made:
            made[law.name] = columns_of(problem, law.candidate, law.shape)
    return np.stack([np.where(problem.mask, np.nan_to_num(made[law.name][law.part]), 0.0) for law in laws])


def wheel_sets_of(problem: Problem) -> tuple[tuple[int, ...], ...]:
    """Return sets of wheels that may have a change in common, by indices: each, all, and those of the machine."""
    count = len(problem.recording.wheels)
    every = tuple(range(count))
    found = [(k,) for k in every] + [every] + [tuple(sorted(each)) for each in problem.wheel_sets]
    return tuple(dict.fromkeys(found))


def allowed(laws: Sequence[Law], columns: Array, sets: Sequence[tuple[int, ...]], wheels: int) -> tuple[Mask, Mask]:
    """Return which law may be on which set from the start, and which may begin later, shape (set, law) each."""
    at_start: Mask = np.zeros((len(sets), len(laws)), np.bool_)
    later = at_start.copy()
    for k, law in enumerate(laws):
        sharing = law.candidate.sharing
        for s, chosen in enumerate(sets):
            kinds = {"all"} if len(chosen) == wheels > 1 else {"one"} if len(chosen) == 1 else {"all", "one"}
            later[s, k] = bool(kinds & set(sharing)) if wheels == 1 else kinds <= set(sharing)
            at_start[s, k] = later[s, k] and not law.begins
    for k, j in _same(columns):
        if laws[j].begins and not laws[k].begins:
            later[:, k] &= ~later[:, j]
    return at_start, later


def _same(columns: Array) -> list[tuple[int, int]]:
    """Return the pairs of laws that have the same column but for its sign and scale."""
    flat = columns.reshape(len(columns), -1)
    size = np.linalg.norm(flat, axis=1)
    cosine = flat @ flat.T / np.maximum(np.outer(size, size), 1e-300)
    alike = np.argwhere(np.abs(cosine) > 1 - SAME_COLUMN)
    return [(int(k), int(j)) for k, j in alike if k != j]
