"""What a term has to gain beyond chance: penalties in units of Δχ² (twice a log likelihood ratio)."""

from __future__ import annotations

from math import log
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.group import Group, Term

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.thresholds import Thresholds

Array = NDArray[np.float64]


def penalty(term: Term, wheel_count: int, thresholds: Thresholds) -> float:
    """Return the penalty of a term less what its own channel credits to it."""
    return full_penalty(term, wheel_count, thresholds) - own_channel_credit(term, thresholds)


def full_penalty(term: Term, wheel_count: int, thresholds: Thresholds) -> float:
    """Return the penalty of a term's coefficients, of its shape's selection, and of the choice of its wheels."""
    group, acting = term.group, term.group.acting
    count = len(group.columns) if acting is None else np.sum(acting[:, list(term.wheels)].any(axis=1))
    total = thresholds.coefficient_penalty * float(count) + group.selection_penalty
    return total + (_of_some_wheels(group, wheel_count, thresholds) if len(term.wheels) < wheel_count else 0.0)


def _of_some_wheels(group: Group, wheel_count: int, thresholds: Thresholds) -> float:
    """Return the penalty of the choice of wheels that are not all."""
    # One wheel alone is the rule for some faults and the exception for what all wheels are built with.
    total = thresholds.single_wheel_penalty if "all" in group.sharing else 0.0
    # Where a corrected effect is on one wheel, that was known before: the wheel of its change was not chosen.
    return total if group.is_change and "all" not in group.sharing else total + 2 * log(2 * wheel_count)


def penalties(
    groups: Sequence[Group], sets: Sequence[tuple[int, ...]], wheel_count: int, thresholds: Thresholds
) -> Array:
    """Return the penalties of groups on sets of wheels, shape (set, group)."""
    all_wheels = tuple(range(wheel_count))
    of_all = np.array([penalty(Term(group, all_wheels), wheel_count, thresholds) for group in groups])
    of_choice = np.array([_of_some_wheels(group, wheel_count, thresholds) for group in groups])
    found = of_all + np.array([len(wheels) < wheel_count for wheels in sets])[:, None] * of_choice
    for place, group in enumerate(groups):
        if group.acting is not None or group.own_channel is not None:  # which wheels they are matters, not how many
            found[:, place] = [penalty(Term(group, wheels), wheel_count, thresholds) for wheels in sets]
    return found


def own_channel_credit(term: Term, thresholds: Thresholds) -> float:
    """Return the part of a fault's Δχ² in its own channel that counts in the predicted one: one cause for both."""
    if term.group.own_channel is None:
        return 0.0
    return min(thresholds.own_channel_share * _own_channel_gain(term), thresholds.largest_own_channel_credit)


def visible_in_own_channel(term: Term, thresholds: Thresholds) -> bool:
    """Return whether a fault's own channel shows it; true of what has no other channel."""
    return term.group.own_channel is None or _own_channel_gain(term) > thresholds.own_channel_visible


def _own_channel_gain(term: Term) -> float:
    assert term.group.own_channel is not None  # noqa: S101  # the callers asked
    return float(np.sum(term.group.own_channel[0][list(term.wheels)]))
