"""Names of a fleet against curves that its recordings have in common: what stays unexplained in all of them together.

As in one recording (`selection.smooth_terms`), a curve wins in two ways: beside the names, where it explains much that
they leave; and against them, where it scores more than they do, which then only imitate it. A curve needs no recording
that shows it by itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.fleet.choice.recordings import shown_beside
from regolithd.calibration.mismatch.fleet.choice.released import with_released
from regolithd.calibration.mismatch.fleet.choice.search import further
from regolithd.calibration.mismatch.fleet.choice.selection import without
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit
    from regolithd.calibration.mismatch.fleet.work.found import Found
    from regolithd.calibration.mismatch.problem.prior import Prior

SPARED = 2
"""Findings that a curve spares, from which names imitate it (a choice: one may be what an inexact law leaves)."""
TRIED = 3
"""Curves that are tried, the best first (a choice: the best may be refused by other recordings)."""


def with_curves(chooser: Chooser, fit: FleetFit, found: Sequence[Found], priors: Mapping[str, Prior]) -> FleetFit:
    """Return the names that keep theirs, and the curves that they leave.

    No curves where parameters that were stated wrongly explain as much of them as a law does that is a little wrong.
    """
    told = _told(chooser, fit, found)
    if not told.curves:
        return fit
    held, freed = chooser.equations, with_released(chooser.equations, fit, found, priors)
    explained = held.explained(fit, ())
    by_curves, by_parameters = (
        held.explained(told, ()) - explained,
        freed.explained(freed.fit(fit.terms), ()) - explained,
    )
    stated_wrongly = freed is not held and by_parameters >= (1 - THRESHOLDS.form_misfit) * by_curves
    return fit if stated_wrongly else told


def _told(chooser: Chooser, fit: FleetFit, found: Sequence[Found]) -> FleetFit:
    against = max(_against(chooser, fit), key=chooser.evidence, default=fit)
    fit = against if _is_ahead(chooser, against, fit, found) else fit
    while (more := max(_beside(chooser, fit), key=chooser.evidence, default=fit)) is not fit:
        fit = more
    return fit


def _against(chooser: Chooser, fit: FleetFit) -> Iterator[FleetFit]:
    """Yield the fits of a curve alone with the names that may stand beside it."""
    for alone in _with_one_more(chooser, chooser.equations.fit(())) if fit.terms else ():
        if (standing := _standing(chooser, chooser.grown(alone, chooser.places))).curves:
            yield standing


def _is_ahead(chooser: Chooser, curve: FleetFit, named: FleetFit, found: Sequence[Found]) -> bool:
    """Return whether a fit with a curve is ahead of names by more than chance, and by more than their laws' misfit.

    Laws that are a little wrong are behind a curve as well, where there are many readings. But where a curve spares
    several of them, with what single recordings show beside them, they only imitate it.
    """
    if chooser.evidence(curve) - chooser.evidence(named) <= THRESHOLDS.smooth_term_entry:
        return False
    misfit = (curve.delta_chi2 - named.delta_chi2) / max(curve.delta_chi2, 1e-9)
    if misfit > THRESHOLDS.form_misfit:
        return True
    return _findings(chooser, named, found) - _findings(chooser, curve, found) >= SPARED


def _findings(chooser: Chooser, fit: FleetFit, found: Sequence[Found]) -> int:
    """Return how many findings an answer has, with those of single recordings."""
    shown = shown_beside(chooser.equations, fit, found)
    return len(fit.terms) + len(shown.effects) + len(shown.unexplained)


def _beside(chooser: Chooser, fit: FleetFit) -> Iterator[FleetFit]:
    """Yield the fits with a further curve, beside which names that gain little are left out.

    What has no law leaks into every law. A curve that gains little is the names' misfit.
    """
    for more in _with_one_more(chooser, fit):
        gain = more.delta_chi2 - fit.delta_chi2
        if gain >= THRESHOLDS.form_misfit * more.delta_chi2:
            standing = _standing(chooser, _without_little(chooser, more, THRESHOLDS.beside_smooth_share * gain))
            if len(standing.curves) > len(fit.curves) and chooser.evidence(standing) > chooser.evidence(fit):
                yield standing


def _with_one_more(chooser: Chooser, fit: FleetFit) -> Iterator[FleetFit]:
    """Yield the fits with one of the best further curves that are significant, in its best place beside all others."""
    equations = chooser.equations
    for score, curve in further(equations, fit, chooser.places, equations.curve_groups)[:TRIED]:
        if score > THRESHOLDS.smooth_term_entry:
            yield chooser.searched_anew(equations.fit((*fit.terms, curve)), chooser.places)


def _without_little(chooser: Chooser, fit: FleetFit, least: float) -> FleetFit:
    """Return a fit without the names that gain less than this."""
    kept = [
        term
        for place, term in enumerate(fit.terms)
        if not term.group.named or fit.delta_chi2 - chooser.equations.fit(without(fit, place)).delta_chi2 >= least
    ]
    return fit if len(kept) == len(fit.terms) else chooser.equations.fit(kept)


def _standing(chooser: Chooser, fit: FleetFit) -> FleetFit:
    """Return a fit without what may not be told, or is not confirmed by other recordings; those with a name first."""
    fit = chooser.equations.fit((*fit.named, *fit.curves))
    while fit.terms:
        refused = [place for place in range(len(fit.terms)) if not chooser.acceptable_term(fit, place)]
        if not refused:
            break
        fit = chooser.equations.fit(without(fit, refused[0]))
    return chooser.confirmed(fit)
