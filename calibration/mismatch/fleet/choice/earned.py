"""Names of a fleet against what single recordings leave unexplained: what has no law leaks into every law.

The rules are those of one recording (`selection.smooth_terms`, `inference.held_out`). A name of the fleet, beside what
its recordings show by themselves, has to be ahead of the answer without it, in which these may show more; has a size
that can be told from nothing, with its sign; and lowers the error of recordings that did not fit it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.fleet.choice.held_out import held_out_squares
from regolithd.calibration.mismatch.fleet.choice.intervals import size_stds
from regolithd.calibration.mismatch.fleet.choice.recordings import shown_beside
from regolithd.calibration.mismatch.fleet.choice.search import penalty
from regolithd.calibration.mismatch.fleet.choice.selection import told_by_others, without
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.recordings import Shown
    from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit, FleetTerm
    from regolithd.calibration.mismatch.fleet.work.found import Found

Own = tuple[int, int]
"""A term that a recording shows by itself, by recording and place."""
FEWEST_HELD_OUT = 2
"""Recordings in which a size acts, of which one can be held out: a single one has no other to fit it."""


def earned(chooser: Chooser, fit: FleetFit, found: Sequence[Found]) -> FleetFit:
    """Return the fit without the names that fall beside what single recordings show, the worst dropped first.

    A name with a size of each rover's own stays on those that show it beside that.
    """
    while fit.terms:
        names = _Names(chooser, fit, tuple(found))
        margins = [names.margin(index) for index in range(len(fit.terms))]
        worst = int(np.argmin(margins))
        if margins[worst] > 0:
            break
        fit = chooser.equations.fit(names.with_less(worst))
    return fit


@dataclass(frozen=True, eq=False)
class _Names:
    """The names of a fleet, and what its recordings were found to show by themselves."""

    chooser: Chooser
    fit: FleetFit
    found: tuple[Found, ...]

    @cached_property
    def _shown(self) -> Shown:
        return shown_beside(self.chooser.equations, self.fit, self.found)

    @cached_property
    def _beside(self) -> tuple[Chooser, FleetFit]:
        """The choice, and the names fitted, where what recordings show takes up what it can."""
        equations = self.chooser.equations.beside(self._shown.terms)
        return replace(self.chooser, equations=equations), equations.fit(self.fit.terms)

    def margin(self, index: int) -> float:
        """Return by how much a name is ahead of what is asked of it; minus infinity where it cannot be one.

        A curve has been held against names already, and those that single recordings show over its covariate are it.
        """
        chooser, beside = self._beside
        if not (self._can_be_told(index) and chooser.acceptable_term(beside, index) and self._lowers_errors(index)):
            return -np.inf
        return self._lead(index) if self.fit.terms[index].group.named else np.inf

    def with_less(self, index: int) -> tuple[FleetTerm, ...]:
        """Return the terms without one; one with a size of each rover's own stays on those that show it beside."""
        chooser, beside = self._beside
        term, rovers = self.fit.terms[index], chooser.showing(beside, index)
        if not term.units.each or rovers in {(), term.units.rovers}:
            return without(self.fit, index)
        on_them = chooser.equations.on_rovers(term, rovers)
        return (*self.fit.terms[:index], on_them, *self.fit.terms[index + 1 :])

    def _lead(self, index: int) -> float:
        """Return the lead over the answer without this name, in which recordings may leave more unexplained.

        Beside what stays unexplained with it too, it must be ahead by its entry, and by its share of what that gains.
        Where nothing does, it has passed its entry, and may only be overtaken by more than a significant curve.
        """
        equations, fit, limits = self.chooser.equations, self.fit, THRESHOLDS
        rest, rovers = equations.fit(without(fit, index)), fit.terms[index].units.rovers
        at = set(equations.of_rovers(rovers))
        own, curves = ({one for one in some if one[0] in at} for some in (self._shown.terms, self._shown.curves))
        further = {one for one in shown_beside(equations, rest, self.found).curves if one[0] in at} - own
        together = equations.explained(fit, own)
        price = penalty(equations, fit.terms[index]) - self._price(further)
        ahead = together - equations.explained(rest, own | further) - price
        if not curves:
            return ahead + limits.smooth_term_entry if further else np.inf
        share = limits.beside_smooth_share * (together - equations.explained(fit, own - curves))
        gained = together - equations.explained(rest, own)
        return min(ahead - self.chooser.entry_threshold, gained - share)

    def _price(self, curves: Collection[Own]) -> float:
        """Return what curves of single recordings have to gain beyond chance, in Δχ²."""
        return sum(self.found[recording].terms[place].penalty for recording, place in curves)

    def _can_be_told(self, index: int) -> bool:
        """Return whether the 90 % interval of one of a name's sizes does not hold 0."""
        chooser, beside = self._beside
        span = beside.spans[index]
        reach = NINETY_PERCENT_STDS * size_stds(chooser.equations, beside)[span]
        return bool(np.any(np.abs(beside.coefficients[span]) > reach))

    def _lowers_errors(self, index: int) -> bool:
        """Return whether a name lowers the error of recordings that did not fit it, where there are such."""
        chooser, beside = self._beside
        factors = chooser.equations.factors(beside.terms[index])
        told = told_by_others(chooser.equations, without(beside, index))
        where = factors.any(axis=0) & told[:, None]
        if factors.any(axis=2).sum(axis=1).max() < FEWEST_HELD_OUT or not where.any():
            return True
        both = ((self.chooser.equations, self.fit), (chooser.equations, beside))
        return all(_gain(*each, index, where) > 0 for each in both)


def _gain(equations: FleetEquations, fit: FleetFit, index: int, where: NDArray[np.bool_]) -> float:
    """Return by how much an effect lowers the sum of squares where it is asked, of recordings that did not fit it."""
    squares = held_out_squares(equations, fit)
    return float((squares.without[index] - squares.after)[where].sum())
