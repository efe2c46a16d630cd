"""Groups that are asked what they gain: what does not depend on what they are fitted beside.

A search asks the same groups round after round, beside other terms each time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.group import Group, Term
from regolithd.calibration.mismatch.regression.penalties import penalties, visible_in_own_channel
from regolithd.calibration.mismatch.regression.screening.batch import Batch

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix

Array = NDArray[np.float64]
Index = NDArray[np.int64]

KINDS = ("all", "some", "one")
"""Of sets of wheels that may share an effect."""


@dataclass(frozen=True, eq=False)
class Asked:
    """Groups, and sets of wheels.

    Attributes
    ----------
    groups, sets: what may enter, and on which wheels
    at: all columns of the groups, ascending
    batches: the groups, by their numbers of columns
    may_share: which sets may share which groups, shape (set, group)
    noise_reductions: of the groups, shape (group,)
    penalties: what each has to gain beyond chance, in Δχ², shape (set, group)
    crosses: weighted sums of products of fitted columns with those at `at`, shape (wheel, other) each, as far as known
    """

    groups: tuple[Group, ...]
    sets: tuple[tuple[int, ...], ...]
    at: Index
    batches: tuple[Batch, ...]
    may_share: NDArray[np.bool_]
    noise_reductions: Array
    penalties: Array
    crosses: dict[int, Array] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        design: DesignMatrix,
        weights: Array,
        folds: tuple[int, ...],
        wheel_sets: Mapping[tuple[int, ...], str],
        groups: tuple[Group, ...],
    ) -> Asked:
        """Return what equations of this design, with these weights (wheel,), on these folds, ask of groups."""
        sets = tuple(wheel_sets)
        at = np.array(sorted({column for group in groups for column in group.columns}), np.int64)
        return cls(
            groups,
            sets,
            at,
            tuple(_batches(design, weights, folds, groups, at)),
            _may_share(design, wheel_sets, len(weights), groups),
            np.array([group.noise_reduction for group in groups]),
            penalties(groups, sets, len(weights), design.problem.thresholds),
        )


def _may_share(
    design: DesignMatrix, sets: Mapping[tuple[int, ...], str], wheel_count: int, groups: Sequence[Group]
) -> NDArray[np.bool_]:
    """Return which sets of wheels may share which groups, shape (set, group).

    The delay of an input that is put on time on some wheels changes nothing on the others, and is not theirs. A fault
    of another channel shows there.
    """
    alone, on_some, all_wheels = wheel_count == 1, design.problem.on_time_on, tuple(range(wheel_count))
    kinds = {kind: [alone or group.may_be_shared(kind) for group in groups] for kind in KINDS}
    shared = np.array([kinds[kind] for kind in sets.values()])
    late = [on_some.get(str(group.shape.get("late")), all_wheels) for group in groups] if on_some else []
    for place, wheels in enumerate(late):
        shared[:, place] &= [set(wheels).issuperset(one) for one in sets]
    for place, group in enumerate(groups):
        if group.own_channel is not None:
            terms = [Term(group, wheels) for wheels in sets]
            shared[:, place] &= [visible_in_own_channel(term, design.problem.thresholds) for term in terms]
    return shared


def _batches(
    design: DesignMatrix, weights: Array, folds: tuple[int, ...], groups: Sequence[Group], at: Index
) -> list[Batch]:
    """Return the groups in batches of equally many columns, which are among those at `at`."""
    found = []
    for size in sorted({len(group.columns) for group in groups}):
        which = [place for place, group in enumerate(groups) if len(group.columns) == size]
        columns = np.array([groups[place].columns for place in which])
        own = np.zeros((len(weights), 0, size, size))
        if size > 1:
            products = [design.own_products(groups[place].columns, folds) for place in which]
            own = np.stack(products, axis=1) * weights[:, None, None, None]
        signs = np.array([groups[place].signs for place in which], np.float64)
        found.append(Batch(np.array(which), np.searchsorted(at, columns), signs, own))
    return found
