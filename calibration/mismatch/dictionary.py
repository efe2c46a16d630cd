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

    from calibration.mismatch.candidates import Candidate, Shape
    from calibration.mismatch.scene import Scene

Array = NDArray[np.float64]
Single = NDArray[np.float32]


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

    @property
    def named(self) -> bool:
        """A candidate, not a curve."""
        return self.candidate is not None


class Dictionary:
    """Columns (scaled to a root mean square of 1 over the mask) and their moments.

    Attributes
    ----------
    columns: shape (column, wheel, time), 0 outside the mask, float32: a few hundred times the recording
    scale: what each column was divided by
    gram, moment, energy: sums of products per fold and wheel: (fold, wheel, column, column), (fold, wheel, column),
        (fold, wheel)
    """

    def __init__(self, scene: Scene, folds: NDArray[np.int64]) -> None:
        self.scene = scene
        self.groups: list[Group] = []
        self.order = np.argsort(folds, kind="stable")
        self.cuts = np.searchsorted(folds[self.order], np.arange(folds.max() + 2))
        self.residual: Single = self._arranged((scene.measured - scene.filled)[None])[0]
        wheels, count = scene.mask.shape[1], len(self.cuts) - 1
        self.columns: Single = np.zeros((0, wheels, len(folds)), np.float32)
        self.scale: Array = np.zeros(0)
        self.gram: Array = np.zeros((count, wheels, 0, 0))
        self.moment: Array = np.zeros((count, wheels, 0))
        self.energy: Array = np.stack(
            [np.sum(part.astype(np.float64) ** 2, axis=1) for part in self._parts(self.residual)]
        )
        self.counts: Array = np.stack(
            [np.sum(part, axis=1) for part in self._parts(scene.mask.T[:, self.order].astype(np.float64))]
        )

    def _arranged(self, values: Array) -> Single:
        """Return (column, time, wheel) as (column, wheel, time) in the order of folds, 0 outside the mask."""
        kept = np.where(self.scene.mask, values, 0.0)
        return np.ascontiguousarray(np.swapaxes(kept, 1, 2)[:, :, self.order], dtype=np.float32)

    def _parts(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        return [values[..., a:b] for a, b in zip(self.cuts[:-1], self.cuts[1:], strict=True)]

    def append(self, columns: Sequence[Array]) -> list[int]:
        """Add columns of shape (time, wheel) and return their places."""
        if not len(columns):
            return []
        fresh = self._arranged(np.stack(columns))
        scale = np.sqrt(np.sum(fresh.astype(np.float64) ** 2, axis=(1, 2)) / max(int(self.scene.mask.sum()), 1))
        scale = np.where(scale > 0, scale, 1.0)
        fresh /= scale[:, None, None].astype(np.float32)
        old, new = len(self.columns), len(fresh)
        self.columns = np.concatenate((self.columns, fresh)) if old else fresh
        self.scale = np.concatenate((self.scale, scale))
        gram = np.zeros((*self.gram.shape[:2], old + new, old + new))
        gram[:, :, :old, :old] = self.gram
        moment = np.zeros((*self.moment.shape[:2], old + new))
        moment[:, :, :old] = self.moment
        for f, (part, added, residual) in enumerate(
            zip(self._parts(self.columns), self._parts(fresh), self._parts(self.residual), strict=True)
        ):
            for w in range(part.shape[1]):
                cross = (added[:, w] @ part[:, w].T).astype(np.float64)
                gram[f, w, old:, :] = cross
                gram[f, w, :, old:] = cross.T
                moment[f, w, old:] = added[:, w] @ residual[w]
        self.gram, self.moment = gram, moment
        return list(range(old, old + new))
