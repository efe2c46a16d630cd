"""The choice of the next experiment: the drive with the largest expected margin between the two closest answers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import MismatchError
from regolithd.calibration.mismatch.experiments.drives import DIRECTION, MOTION, UNLOADED, Drives
from regolithd.calibration.mismatch.experiments.margins import (
    Expected,
    Hypothesis,
    Pair,
    expected_of,
    precisions,
    worst,
)
from regolithd.calibration.mismatch.experiments.settings import Setting, predicts_row_by_row
from regolithd.calibration.mismatch.regression.likelihood.as_read import long_run_weights

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.regression.group import Term
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

Array = NDArray[np.float64]

WORTH_VARYING = 0.8
"""An experiment that varies less is preferred if it has this share of the largest margin (a choice: it is easier to
drive, and takes a quarter longer at most)."""
NOTHING_LOST = 0.999
"""Share of the margin that is left where nothing was lost: rounding (a choice)."""
TOLD_APART = 1.0
"""Δχ² below which the longest drive that varies everything does not tell two answers apart (a choice: odds of e^½)."""
DURATIONS = 24
"""Durations that are tried, from the shortest to the longest in geometric steps (a choice)."""


@dataclass(frozen=True, eq=False)
class Choice:
    """An experiment, and what is expected of it.

    Attributes
    ----------
    varied: the covariates to vary
    settings: of those that have a range
    lift: whether a part is without load
    duration_s: the shortest after which the closest pair is told apart nine times in ten, or the longest proposed
    margin: the Δχ² expected of that duration between the closest pair
    pair: the true answer and the other of the closest pair
    needed: the margin that tells them apart nine times in ten
    """

    varied: tuple[str, ...]
    settings: tuple[Setting, ...]
    lift: bool
    duration_s: float
    margin: float
    pair: Pair
    needed: float


@dataclass(frozen=True, eq=False)
class Experimenter:
    """What can be predicted for a recording's machine; made once by `experimenter_of`, used for every set of answers.

    Attributes
    ----------
    equations: of the recording
    entry_threshold: score above which an effect is named
    drives: that can be predicted; None: none
    information_per_s: one over the noise's long-run variance, times the readings in a second, shape (wheel,)
    unpredictable: why no drive can be predicted, as a clause; empty where drives can be
    """

    equations: NormalEquations
    entry_threshold: float
    drives: Drives | None
    information_per_s: Array
    unpredictable: str = ""

    def on(self, equations: NormalEquations) -> Experimenter:
        """Return the same for equations of the same recording that have further columns; drives are kept."""
        return replace(self, equations=equations)

    @property
    def needed(self) -> float:
        """The margin after which an answer is named, and the right one of two, nine times in ten."""
        limits = self.equations.thresholds
        return (sqrt(self.entry_threshold + limits.coefficient_penalty) + limits.detection_quantile) ** 2

    def choose(self, hypotheses: Sequence[Hypothesis], given: Sequence[Term]) -> Choice | None:
        """Return the experiment with the largest margin of the closest pair; None where none can be predicted.

        All that can be varied is left out step by step, what adds nothing at once, then each time what lowers that
        margin least. Pairs that not even the drive that varies everything tells apart do not count.
        """
        if self.drives is None or len(hypotheses) < 2:
            return None
        try:
            return self._best(self.drives, hypotheses, given)
        except MismatchError:
            return None  # a user's simulation or candidate that refuses a drive

    def _best(self, drives: Drives, hypotheses: Sequence[Hypothesis], given: Sequence[Term]) -> Choice | None:
        length_s = self.equations.problem.length_s
        varied = frozenset(drives.elements)
        everything = self._expected(varied, hypotheses, given)
        longest_s = self.equations.thresholds.longest_experiment * length_s
        apart = [pair for pair, margin in everything.margins(longest_s).items() if margin > TOLD_APART]
        if not apart:
            return None
        tried = {varied: (worst(everything.margins(length_s), apart)[1], everything)}

        def margin(varied: frozenset[str]) -> float:
            if varied not in tried:
                expected = self._expected(varied, hypotheses, given)
                tried[varied] = worst(expected.margins(length_s), apart)[1], expected
            return tried[varied][0]

        needless = {each for each in varied if margin(varied - {each}) >= NOTHING_LOST * margin(varied)}
        if needless < varied and margin(varied - needless) >= NOTHING_LOST * margin(varied):
            varied -= needless
        while len(varied) > 1:
            varied = max((varied - {each} for each in sorted(varied)), key=margin)
        enough = WORTH_VARYING * max(margin(each) for each in tried)
        best = min((each for each in tried if margin(each) >= enough), key=lambda each: (len(each), -margin(each)))
        return self._choice(best, tried[best][1], apart)

    def _expected(self, varied: frozenset[str], hypotheses: Sequence[Hypothesis], given: Sequence[Term]) -> Expected:
        assert self.drives is not None  # noqa: S101  # as `choose` has seen
        return expected_of(
            self.drives(varied),
            hypotheses,
            given,
            precision=precisions(self.equations),
            information_per_s=self.information_per_s,
        )

    def _choice(self, varied: frozenset[str], expected: Expected, apart: Sequence[Pair]) -> Choice:
        limits, length_s = self.equations.thresholds, self.equations.problem.length_s
        ends = limits.shortest_experiment * length_s, limits.longest_experiment * length_s
        found = [(float(each), worst(expected.margins(float(each)), apart)) for each in np.geomspace(*ends, DURATIONS)]
        duration_s, (pair, margin) = next((each for each in found if each[1][1] >= self.needed), found[-1])
        assert self.drives is not None  # noqa: S101
        both_ways = {DIRECTION} if varied & MOTION else set()
        ordered = tuple(each for each in self.drives.elements if each in (varied | both_ways) - {UNLOADED})
        settings = tuple(each for name, each in self.drives.settings.items() if name in varied)
        return Choice(ordered, settings, UNLOADED in varied, duration_s, margin, pair, self.needed)


def experimenter_of(equations: NormalEquations, entry_threshold: float) -> Experimenter:
    """Return what can be predicted for the machine of a recording."""
    problem = equations.problem
    share = problem.mask.sum(axis=0) / len(problem.mask)
    information_per_s = long_run_weights(equations, equations.fit(())) * share / problem.recording.step_s
    drives, why = _drives_of(equations)
    return Experimenter(equations, entry_threshold, drives, information_per_s, why)


def _drives_of(equations: NormalEquations) -> tuple[Drives | None, str]:
    """Return the drives that can be predicted, or why none can."""
    problem = equations.problem
    if problem.stated:
        return None, "the simulation was corrected by effects"
    candidates = dict.fromkeys(group.candidate for group in equations.design.groups)
    covariates = [name for each in candidates if each is not None for name in each.varied(problem)]
    try:
        if not predicts_row_by_row(problem):
            return None, "a prediction depends on other rows too: the simulation has a state or a rate of change"
        drives = Drives(problem, covariates)
    except MismatchError:
        return None, "the simulation accepts no other inputs than those recorded"
    return (drives, "") if drives.settings else (None, "no column sets a covariate alone")
