"""All columns of all candidates, and their sums of products: after this, the search is algebra on small matrices.

Sums are kept for each wheel and each fold. A term on any set of wheels, fitted on any set of folds, is then a matter
of adding them up: time is walked through once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Shape
    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]
Single = NDArray[np.float32]

FIRST_ROOM = 640
"""Columns to make room for at first: about what a rover's library needs."""


@dataclass(frozen=True)
class Group:
    """Columns that enter together: one candidate in one shape, or a smooth curve over a covariate without a name.

    Attributes
    ----------
    name: the candidate's, or the covariate's
    columns: where its columns are in the dictionary
    signs: the coefficients' signs, 0 for either
    sharing: "all" and/or "one"
    complexity: the price of its shape having been chosen from many
    """

    name: str
    columns: tuple[int, ...]
    signs: tuple[int, ...]
    sharing: tuple[str, ...]
    complexity: float
    candidate: Candidate | None = None
    shape: Shape = field(default_factory=dict)
    flavour: str = ""
    quieter: float = 1.0
    """How many times less noise there is where its columns live than the long run has: for a line in the spectrum."""
    evidence: tuple[Array, Array] | None = None
    """For a fault of another channel: for each wheel, what that channel says for it, and how large it is there."""

    alive: NDArray[np.bool_] | None = None
    """Which column does anything on which wheel (column, wheel); all of them on all where it is not said."""

    @property
    def span(self) -> slice:
        """Its columns, which lie side by side."""
        return slice(self.columns[0], self.columns[-1] + 1)

    @property
    def named(self) -> bool:
        """A candidate, not a curve."""
        return self.candidate is not None


class Dictionary:
    """Columns (scaled to a root mean square of 1 over the mask) and their moments.

    Attributes
    ----------
    groups: which columns enter together
    residual: measured less predicted, shape (wheel, time), in the order of folds
    order: the instants in the order of folds
    scale: what each column was divided by
    energy, counts: sum of squares and number of the residual's values, shape (fold, wheel)
    """

    def __init__(self, problem: Problem, folds: NDArray[np.int64]) -> None:
        self.problem = problem
        self.groups: list[Group] = []
        self.order = np.argsort(folds, kind="stable")
        self.cuts = np.searchsorted(folds[self.order], np.arange(folds.max() + 2))
        self.residual: Single = self._arranged((problem.measured - problem.filled)[None])[0]
        self._wheels, self._folds = problem.mask.shape[1], len(self.cuts) - 1
        self._size = 0
        self._columns: Single = np.zeros((0, self._wheels, len(folds)), np.float32)
        self._gram: Array = np.zeros((self._folds, self._wheels, 0, 0))
        self._moment: Array = np.zeros((self._folds, self._wheels, 0))
        self.scale: Array = np.zeros(0)
        parts = self._parts(self.residual)
        self.energy: Array = np.stack([np.sum(part.astype(np.float64) ** 2, axis=1) for part in parts])
        known = self._parts(problem.mask.T[:, self.order].astype(np.float64))
        self.counts: Array = np.stack([np.sum(part, axis=1) for part in known])

    @property
    def columns(self) -> Single:
        """Every column, shape (column, wheel, time), in the order of folds, 0 outside the mask."""
        return self._columns[: self._size]

    @property
    def gram(self) -> Array:
        """Sums of products of columns, shape (fold, wheel, column, column)."""
        return self._gram[:, :, : self._size, : self._size]

    @property
    def moment(self) -> Array:
        """Sums of products of columns and residual, shape (fold, wheel, column)."""
        return self._moment[:, :, : self._size]

    def _arranged(self, values: Array) -> Single:
        """Return (column, time, wheel) as (column, wheel, time) in the order of folds, 0 outside the mask."""
        kept = np.where(self.problem.mask, values, 0.0)
        return np.ascontiguousarray(np.swapaxes(kept, 1, 2)[:, :, self.order], dtype=np.float32)

    def _parts(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        return [values[..., a:b] for a, b in zip(self.cuts[:-1], self.cuts[1:], strict=True)]

    def append(self, columns: Sequence[Array]) -> list[int]:
        """Add columns of shape (time, wheel) and return their places."""
        if not len(columns):
            return []
        fresh = self._arranged(np.stack(columns))
        scale = np.sqrt(np.sum(fresh.astype(np.float64) ** 2, axis=(1, 2)) / max(int(self.problem.mask.sum()), 1))
        scale = np.where(scale > 0, scale, 1.0)
        fresh /= scale[:, None, None].astype(np.float32)
        old, new = self._size, self._size + len(fresh)
        self._make_room(new)
        self._columns[old:new] = fresh
        self._size = new
        self.scale = np.concatenate((self.scale, scale))
        parts = (self._parts(values) for values in (self.columns, fresh, self.residual))
        for f, (part, added, residual) in enumerate(zip(*parts, strict=True)):
            for w in range(self._wheels):
                cross = added[:, w] @ part[:, w].T
                self._gram[f, w, old:new, :new] = cross
                self._gram[f, w, :new, old:new] = cross.T
                self._moment[f, w, old:new] = added[:, w] @ residual[w]
        return list(range(old, new))

    def _make_room(self, size: int) -> None:
        """Let the arrays grow by half as much again, so that growing costs little on the whole."""
        room = len(self._columns)
        if size <= room:
            return
        more = max(size, room + room // 4, FIRST_ROOM)
        for name, axes in (("_columns", (0,)), ("_gram", (2, 3)), ("_moment", (2,))):
            before = getattr(self, name)
            shape = tuple(more if axis in axes else length for axis, length in enumerate(before.shape))
            grown = np.zeros(shape, before.dtype)
            grown[tuple(slice(0, length) for length in before.shape)] = before
            setattr(self, name, grown)
