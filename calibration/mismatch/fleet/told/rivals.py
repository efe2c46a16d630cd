"""Effects that explain a fleet's recordings as well as those that were named."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Indistinguishable
from regolithd.calibration.mismatch.fleet.choice.search import further, place_of, score
from regolithd.calibration.mismatch.fleet.choice.selection import without
from regolithd.calibration.mismatch.inference.other_answers.experiment import as_it_runs
from regolithd.calibration.mismatch.inference.other_answers.identifiability import wrong_choice_rate
from regolithd.calibration.mismatch.inference.statements import capital
from regolithd.calibration.mismatch.problem.words import in_words
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit, FleetTerm
    from regolithd.calibration.mismatch.simulation.simulation import Simulation


def rivals(
    chooser: Chooser, fit: FleetFit, simulation: Simulation, labels: Mapping[str, str]
) -> tuple[Indistinguishable, ...]:
    """Return, for each effect that has some, those that could be true in its place on the same wheels.

    `labels` are what the machine calls its covariates.
    """
    found = []
    for index, term in enumerate(fit.named):
        members = [term, *_in_its_place(chooser, fit, index)]
        names = tuple(dict.fromkeys(member.name for member in members))
        if len(names) > 1:
            found.append(_with_experiment(names, members, simulation, labels))
    return tuple(dict.fromkeys(found))


def _in_its_place(chooser: Chooser, fit: FleetFit, index: int) -> list[FleetTerm]:
    equations, term = chooser.equations, fit.terms[index]
    rest = equations.fit(without(fit, index))
    there = place_of(equations, replace(term.units, each=False))
    members = []
    for _, rival in further(equations, rest, [there])[: THRESHOLDS.rivals_tried]:
        trial = equations.fit((*rest.terms, rival))
        if rival.name != term.name and chooser.acceptable(trial) and _could_be_true(equations, fit, trial):
            members.append(rival)
    return members


def _could_be_true(equations: FleetEquations, named: FleetFit, rival: FleetFit) -> bool:
    """Return whether the rival, were it true, would trail the named effect by this much often enough."""
    lead = max(score(equations, named) - score(equations, rival) - THRESHOLDS.lead_margin, 0.0)
    both = equations.fit((*named.terms, rival.terms[-1]))
    outside = _outside(both, rival)
    if outside <= 1e-9 or named.delta_chi2 - rival.delta_chi2 < THRESHOLDS.equal_gain:
        return True
    return wrong_choice_rate(lead, outside) > THRESHOLDS.confusion_rate


def _outside(both: FleetFit, rival: FleetFit) -> float:
    """Return the energy of the rival, at its own size, outside the span of the named effects."""
    values = rival.coefficients[rival.spans[-1]]
    covariance = both.covariance[both.spans[-1], both.spans[-1]]
    return float(values @ np.linalg.pinv(covariance, rcond=1e-10) @ values)


def _with_experiment(
    names: tuple[str, ...], members: list[FleetTerm], simulation: Simulation, labels: Mapping[str, str]
) -> Indistinguishable:
    """Return the set with the drive that varies the covariate of each member."""
    candidates = [member.group.candidate for member in members]
    drives = list(dict.fromkeys(candidate.instruction(simulation) for candidate in candidates))
    lift = bool(simulation.unloaded_experiment) and any(candidate.run_unloaded for candidate in candidates)
    sentence = "; then ".join([*drives, simulation.unloaded_experiment] if lift else drives)
    return Indistinguishable(
        effects=names,
        experiment=f"{capital(in_words(sentence, labels))}.",
        vary=tuple(dict.fromkeys(name for each in candidates for name in as_it_runs(each.vary, simulation))),
        duration_s=0.0,
        lift=lift,
        channel=simulation.channel,
    )
