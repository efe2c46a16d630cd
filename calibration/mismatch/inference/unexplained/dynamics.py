"""What to look at where the residual follows what was before: of the prediction, of the acceleration, or by a state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.data.slow_channels import rows_apart, rows_held
from regolithd.calibration.mismatch.problem.state.state_memory import memory_s, through_state
from regolithd.calibration.mismatch.problem.words import with_article, word_for
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.groups.lagged_groups import LAGGED
from regolithd.calibration.mismatch.regression.groups.smooth_groups import with_group
from regolithd.calibration.mismatch.regression.groups.state_groups import ON_STATE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.data.slow_channels import Between
    from regolithd.calibration.mismatch.selection.decision import Decision

AS_HELD = 0.75
"""A held reading is half a period old on average; a delay within this share of that may be the holding (a choice: in
20 recordings with held inputs, the delays found were 0.6 to 1.7 times half a period)."""


def notes_on_dynamics(decision: Decision) -> tuple[str, ...]:
    """Return a note where something is unexplained over the past: what it may be, and what would tell."""
    return (*_note_on_lags(decision), *_notes_on_states(decision))


def notes_on_held_inputs(
    recording: Recording, late_inputs: Mapping[str, float], between: Mapping[str, Between]
) -> tuple[str, ...]:
    """Return a note on each late input whose readings are held for about twice its delay [s].

    `recording` is as it was read: an input that is put on time may change a row later. Readings are held by the logger,
    which repeats them, or as the simulation asks, which says so in `between`.
    """
    notes = []
    for name, delay_s in late_inputs.items():
        repeated, asked = rows_held(recording, name), rows_apart(recording, name) if between.get(name) == "hold" else 1
        held = max(repeated, asked)
        on_average = held * recording.step_s / 2
        if held == 1 or abs(delay_s / on_average - 1) > AS_HELD:
            continue
        if repeated > 1:
            notes.append(
                f"{name} repeats each of its readings for {held} rows. If its logger holds them, they are "
                f"{on_average:g} s old on average, which is about the delay: leave the repetitions blank, and it is "
                f"on straight lines between its readings."
            )
        else:
            notes.append(
                f"{name} is read every {held} rows and held in between, as `between_readings` says. If it changes "
                f"between its readings, these are {on_average:g} s old on average, which is about the delay: state "
                f'"linear" for it, and it is on straight lines.'
            )
    return tuple(notes)


def _note_on_lags(decision: Decision) -> tuple[str, ...]:
    """Return a note on what follows the past of the prediction, or of the acceleration.

    Parameters with wide priors can stand for a part of a delay, which then has not the form of a delay any more.
    """
    lagged = [term.name for term in decision.unnamed if term.name in LAGGED]
    if not lagged:
        return ()
    problem = decision.equations.problem
    past, channel = word_for(lagged[0], problem.labels), problem.simulation.channel
    note = (
        f"What is unexplained over the {past} is how {channel} follows in time: a late reading, a filter, an "
        f"oscillation, or a time constant that is stated wrongly. Parameters with wide priors can hide that it is a "
        f"delay: state those better that change how fast the prediction follows."
    )
    return (note,)


def _notes_on_states(decision: Decision) -> tuple[str, ...]:
    """Return a note on each covariate over which something acts on a state of the simulation."""
    problem = decision.equations.problem
    terms = {term.name: term for term in decision.unnamed if term.group.coupling == ON_STATE}
    memory = float(f"{memory_s(problem):.2g}") if terms else 0.0
    notes = []
    for name, term in terms.items():
        over = with_article(name, problem.labels)
        note = (
            f"What is unexplained over {over} acts on a state of the simulation, which shows it for about {memory:g} "
            "s: it is left out of a balance, as of heat, of volume or of forces. No curve over it is fitted."
        )
        if _is_a_constant(decision, term):
            note += (
                f" It hardly depends on {over}: a constant in the balance explains as much, and so does an offset of "
                f"the readings of {problem.simulation.channel}, with the first of which the simulation begins."
            )
        notes.append(note)
    return tuple(notes)


def _is_a_constant(decision: Decision, term: Term) -> bool:
    """Return whether a term's coefficients gain less beyond a constant on the state than they are charged."""
    problem, equations = decision.equations.problem, decision.equations
    constant = through_state(problem, np.ones(problem.mask.shape), memory_s(problem))
    design = with_group(equations.design, term.name, [constant], ON_STATE)
    rest = [each for each in decision.whole.terms if each is not term]
    beside = equations.over(design)
    as_told, alone = (beside.fit((*rest, each)) for each in (term, Term(design.groups[-1], term.wheels)))
    further = len(term.group.columns) - 1
    return as_told.delta_chi2 - alone.delta_chi2 < equations.thresholds.coefficient_penalty * further
