"""Initial states that are further off than the noise of a reading: neither noise nor physics that a name stands for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Unexplained
from regolithd.calibration.mismatch.inference.evidence import wheel_names
from regolithd.calibration.mismatch.inference.statements import listed
from regolithd.calibration.mismatch.problem.state.state_memory import longest_memory_s
from regolithd.calibration.mismatch.regression.residuals import residual_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.selection.decision import Decision

SHOWN = 3.0
"""Time constants after which the rest is not told (a choice: a twentieth is left)."""


def with_initial_states(told: Answer, decision: Decision) -> Answer:
    """Return the answer; unexplained from the first to the last run whose initial state is off, if any is."""
    equations, whole = decision.equations, decision.whole
    problem, nuisance = equations.problem, equations.nuisance
    shifts = equations.shifts_of_parameters(whole)[nuisance.count :]
    furthest = equations.thresholds.furthest_prior_stds
    off = [(shift, state) for shift, state in zip(shifts, nuisance.states, strict=True) if abs(shift) > furthest]
    if not off:
        return told
    added = sum(shift * state.column for shift, state in off)
    on = problem.mask & np.isin(np.arange(problem.mask.shape[1]), [state.wheel for _, state in off])
    shown, left = np.asarray(added)[on], residual_of(equations, whole)[on]
    runs = sorted((state.rows for _, state in off), key=lambda rows: rows.start)
    memory, time_s = longest_memory_s(problem), problem.time_s[:, 0]
    place = Unexplained(
        channel=problem.simulation.channel,
        wheels=wheel_names(problem, np.flatnonzero(on.any(axis=0)).tolist()),
        covariate="time",
        from_s=float(time_s[runs[0].start]),
        to_s=float(min(time_s[runs[-1].start] + SHOWN * memory, time_s[runs[-1].stop - 1])),
        share_of_residual=float(np.mean(shown**2) / np.mean((shown + left) ** 2)),
    )
    numbers = sorted({state.run for _, state in off})
    note = _note(problem.simulation.channel, numbers, len(problem.recording.runs), memory)
    return replace(told, verdict="unexplained", unexplained=(*told.unexplained, place), notes=(*told.notes, note))


def _note(channel: str, off: Sequence[int], runs: int, memory_s: float) -> str:
    """Return what is wrong as these of the runs begin, and what to do."""
    numbers = [str(run) for run in off]
    if runs == 1:
        where = "the recording begins"
    else:
        where = f"run {numbers[0]} begins" if len(numbers) == 1 else f"runs {listed(numbers)} begin"
    return (
        f"As {where}, {channel} is off by more than a reading's noise, and by ever less as the simulation's state "
        f"forgets, for about {memory_s:.2g} s. Check the initial state: let `predict` begin with what was measured "
        f"there, or state it as a parameter."
    )
