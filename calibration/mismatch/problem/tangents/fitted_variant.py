"""Physics that a simulation has as a variant: the change of its prediction, over the value that was fitted.

`Problem.secant` differences the prediction over a step that the candidate's author chose. Where the variant does not
act in proportion to its value, as a loss in a balance of heat, a size that is fitted with another step is biased.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]
Shape = dict[str, float | str]

VARIANT_VALUE = "variant_value"
"""The shape parameter that holds the value of the variant over which the prediction's change is taken."""
FURTHEST_VALUE = 100.0
"""Ratio of a fitted value and the author's step, or its reciprocal, at most (a choice: beyond it rounding is all that
is differenced, or the step was no expectation)."""


def over_fitted_value(problem: Problem, shape: Mapping[str, float | str]) -> Problem:
    """Return the problem with secants of variants over the value that the shape holds; as it is where it holds none."""
    return replace(problem, variant_value=float(shape[VARIANT_VALUE])) if VARIANT_VALUE in shape else problem


def at_fitted_value(problem: Problem, shape: Shape, values: Sequence[float], columns: Array, tolerance: float) -> Shape:
    """Return the shape at the value of a variant that was fitted.

    It is the shape as it is where the one column is not the change by a variant per unit, where it is the same over the
    fitted value (the variant acts in proportion), where the change itself is the same (a switch), and where the
    simulation predicts nothing there.

    Parameters
    ----------
    columns: of this shape, shape (column, time, wheel)
    tolerance: of a column, relative to its root mean square
    """
    found = _differenced(problem, columns) if len(values) == len(columns) == 1 else None
    if found is None:
        return shape
    name, step, sign = found
    value = sign * float(values[0])
    if not 1 / FURTHEST_VALUE <= abs(value / step) <= FURTHEST_VALUE:
        return shape
    try:
        fitted = sign * problem.secant(name, value)[problem.mask]
    except SimulationError:
        return shape
    column = columns[0][problem.mask]
    least = tolerance * float(np.linalg.norm(column))
    in_proportion = not np.linalg.norm(fitted - column) > least  # also where there is no prediction
    switched = np.linalg.norm(fitted * value - column * step) <= least * abs(step)
    return shape if in_proportion or switched else {**shape, VARIANT_VALUE: value}


def _differenced(problem: Problem, columns: Array) -> tuple[str, float, float] | None:
    """Return the variant, the step over which the one column is its change per unit, and with which sign; or None."""
    variants = problem.simulation.variants()
    for (name, step), change in problem.made.items():
        if name in variants:
            for sign in (1.0, -1.0):  # of a loss whose size counts positive, the column may have the minus
                if np.array_equal(sign * change[problem.mask], columns[0][problem.mask]):
                    return name, step, sign
    return None
