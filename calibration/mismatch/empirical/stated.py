"""Empirical curves that a corrected simulation has: what each adds to the prediction, and how well it is known.

The curve as a whole is an effect whose size may have changed. Its shape is known as its band says: the value at each
knot is a free parameter with that standard deviation, so that a later recording which agrees is consistent.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.candidate import Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.regression.groups.smooth_groups import acting
from regolithd.calibration.mismatch.signal.normal_interval import std_of_interval

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.corrections.empirical_curve import StatedCurve
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]

FACTOR = "factor"
"""The curve's coefficient, by which its values are multiplied: 1 is as corrected."""
EMPIRICAL, OVER = "empirical-", "-over-"
"""How a curve's name begins, and what stands in it before its covariate."""
LEAST_TOLD = 0.01
"""Share of the readings beyond a curve's range from which on that is told (a choice: its range leaves out 1 %)."""


class EmpiricalCurveLaw(Candidate):
    """An empirical curve as an effect with one coefficient, its factor; no search names it."""

    coefficients: ClassVar = (Coefficient(FACTOR, "1"),)

    def __init__(self, stated: StatedCurve) -> None:
        self.stated = stated
        self.name = name_of(stated)  # type: ignore[misc]
        self.covariate = self.imitated_over = stated.covariate  # type: ignore[misc]
        self.equation = f"an empirical curve over {stated.covariate}"  # type: ignore[misc]
        self.words = "what an empirical curve describes"  # type: ignore[misc]
        self.signature = "the curve that was found"  # type: ignore[misc]
        self.experiment = f"vary {{{stated.covariate}}} over the curve's range"  # type: ignore[misc]
        self.source = "a comparison with a recording"  # type: ignore[misc]
        self.label = curve_label(self.name)  # type: ignore[misc]
        self.along_motion = stated.curve.coupling.startswith("drag")  # type: ignore[misc]
        self.vary = (stated.covariate,)  # type: ignore[misc]
        self.requires = (stated.covariate,)  # type: ignore[misc]

    def columns(self, problem: Problem, shape: Shape) -> Array:  # noqa: ARG002
        """Return what the curve adds to the prediction; outside its range it keeps its end values."""
        x, factor = self._course(problem)
        curve = self.stated.curve
        return np.where(np.isfinite(x), np.interp(x, curve.at, curve.value), 0.0)[None] * factor

    def deviations(self, problem: Problem) -> Array:
        """Return what one standard deviation of the value at each knot adds, shape (knot, time, wheel)."""
        x, factor = self._course(problem)
        curve = self.stated.curve
        stds = std_of_interval(np.array(curve.low), np.array(curve.high))
        hats = [np.where(np.isfinite(x), np.interp(x, curve.at, row), 0.0) for row in np.diag(stds)]
        on = np.isin(np.array(problem.recording.wheels, dtype=object), list(self.stated.wheels))
        return np.where(problem.mask & on, np.stack(hats) * factor, 0.0)

    def _course(self, problem: Problem) -> tuple[Array, Array]:
        """Return the covariate and the factor, shape (time, wheel) each."""
        course_of(problem, self.stated)
        known = replace(problem, covariates={**problem.constants, **problem.covariates})
        try:
            return acting(known, self.stated.covariate, self.stated.curve.coupling)
        except KeyError as error:
            told = f"acts as {self.stated.curve.coupling!r}, which this machine cannot"
            raise SimulationError(f"[[empirical_curves]] over {self.stated.covariate} {told}") from error


def name_of(stated: StatedCurve) -> str:
    """Return what a curve is called among the changes: how it acts, and over what."""
    how = stated.curve.coupling.replace(",", "").replace(" ", "-")
    return f"{EMPIRICAL}{how}{OVER}{stated.covariate}"


def curve_label(name: str) -> str:
    """Return the label of a curve of this name, with its covariate in braces; empty: it is the name of no curve."""
    of_curve, _, covariate = name.partition(OVER)
    return f"empirical curve over the {{{covariate}}}" if covariate and of_curve.startswith(EMPIRICAL) else ""


def course_of(problem: Problem, stated: StatedCurve) -> Array:
    """Return a curve's covariate, or its magnitude, shape (time, wheel).

    Raises
    ------
    SimulationError
        When the recording does not have it.
    """
    values = {**problem.constants, **problem.covariates}.get(stated.covariate)
    if values is None:
        raise SimulationError(
            f"[[empirical_curves]] depends on {stated.covariate}, which this recording does not have: record it, or "
            "take the curve out of the file"
        )
    return np.abs(values) if stated.curve.magnitude else values


def beyond_the_range(problem: Problem, curves: Sequence[StatedCurve]) -> tuple[str, ...]:
    """Return a note of each curve whose range the recording leaves."""
    notes = []
    for stated in curves:
        x, (low, high) = course_of(problem, stated), (stated.curve.at[0], stated.curve.at[-1])
        on = np.isin(np.array(problem.recording.wheels, dtype=object), list(stated.wheels))
        known = problem.mask & on & np.isfinite(x)
        share = float(np.mean((x[known] < low) | (x[known] > high))) if known.any() else 0.0
        if share > LEAST_TOLD:
            notes.append(
                f"{100 * share:.0f} % of the readings lie outside the range of the empirical curve over "
                f"{stated.covariate} ({low:.4g} to {high:.4g}): there it keeps its end values, and proves nothing."
            )
    return tuple(notes)
