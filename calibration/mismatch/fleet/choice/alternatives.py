"""Other choices of a fleet: one name less, one more, or one in another's place, and how far they are behind.

As of one recording (`inference.other_answers.alternatives`): by the score of all terms, less what each had to gain to
enter. Only those count that could have been chosen, and whose effects other recordings confirm. What is ahead was
refused beside what single recordings show, or by held-out recordings: it is as probable at most.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.fleet.choice.search import further
from regolithd.calibration.mismatch.fleet.choice.selection import without
from regolithd.calibration.mismatch.inference.other_answers.alternatives import LARGEST_MARGIN, Alternative
from regolithd.calibration.mismatch.selection.decision import UNEXPLAINED
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit, FleetTerm


def other_choices(chooser: Chooser, fit: FleetFit) -> tuple[Alternative, ...]:
    """Return the other sets of names of one step's difference, best first."""
    told, evidence = _names(fit), chooser.evidence(fit)
    best: dict[tuple[str, ...], float] = {}
    for trial in _neighbours(chooser, fit):
        names = _names(trial)
        margin = max(evidence - chooser.evidence(trial), 0.0)
        if names != told and margin < best.get(names, LARGEST_MARGIN) and chooser.stands(trial):
            best[names] = margin
    found = [Alternative(names, margin) for names, margin in best.items()]
    return tuple(sorted(found, key=lambda other: other.margin))


def _neighbours(chooser: Chooser, fit: FleetFit) -> Iterator[FleetFit]:
    """Yield the fits with one effect less, with the best others in its place anywhere, and with one more."""
    equations, tried = chooser.equations, THRESHOLDS.rivals_tried
    for index in range(len(fit.terms)):
        rest = equations.fit(without(fit, index))
        yield rest
        for other in _further(chooser, rest, tried):
            yield equations.fit((*rest.terms, other))
    for more in _further(chooser, fit, tried):
        trial = equations.fit((*fit.terms, more))
        if chooser.worthwhile(fit, trial):
            yield trial


def _further(chooser: Chooser, fit: FleetFit, tried: int) -> Iterator[FleetTerm]:
    """Yield the best further names, and the best further curve."""
    equations = chooser.equations
    for groups, most in ((equations.named_groups, tried), (equations.curve_groups, 1)):
        for _, term in further(equations, fit, chooser.places, groups)[:most]:
            yield term


def _names(fit: FleetFit) -> tuple[str, ...]:
    return tuple(sorted({term.name if term.group.named else UNEXPLAINED for term in fit.terms}))
