"""The design matrix: every column of every group, with sums of products for each wheel and each fold.

A term on any set of wheels, fitted on any set of folds, needs only those sums. They are computed when they are first
asked for, of all columns at once that came since: products of a few columns with many cost as much as reading the many.
A design matrix is immutable; `extended` returns one with further columns.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.whitening import NOT_WHITENED, Whitening

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.group import Group

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Readings = tuple[NDArray[np.int64], tuple[slice, ...]]

FIRST_CAPACITY = 960
"""Columns allocated at first: about what a rover's library needs."""
LONGEST_BRIDGE = 4
"""Usual steps between readings that may be left out before a new run begins (a choice: blanks are short)."""
CHUNK = 64
"""Columns that are whitened at once."""


class _Storage:
    """Growing arrays behind a design matrix and those that it was extended from, which see only their own columns."""

    def __init__(self, folds: int, wheels: int, instants: int) -> None:
        self.used = 0
        self.summed = 0
        self.columns: Single = np.zeros((0, wheels, instants), np.float32)
        self.gram: Array = np.zeros((folds, wheels, 0, 0))
        self.moment: Array = np.zeros((folds, wheels, 0))

    def branched(self, used: int) -> _Storage:
        """Return a copy with the first `used` columns."""
        copy = _Storage(self.gram.shape[0], *self.columns.shape[1:])
        copy.used, copy.summed = used, min(used, self.summed)
        copy.columns = self.columns[:used].copy()
        copy.gram, copy.moment = self.gram[:, :, :used, :used].copy(), self.moment[:, :, :used].copy()
        return copy

    def reserve(self, size: int) -> None:
        """Grow the arrays by a quarter at least, so that growth costs little on the whole."""
        capacity = len(self.columns)
        if size <= capacity:
            return
        more = max(size, capacity + capacity // 4, FIRST_CAPACITY)
        self.columns = _grown(self.columns, more, (0,))
        self.gram = _grown(self.gram, more, (2, 3))
        self.moment = _grown(self.moment, more, (2,))


def _grown(values: NDArray[Any], length: int, axes: tuple[int, ...]) -> NDArray[Any]:
    """Return an array with these axes lengthened by zeros."""
    grown = np.zeros([length if axis in axes else size for axis, size in enumerate(values.shape)], values.dtype)
    grown[tuple(slice(0, size) for size in values.shape)] = values
    return grown


@dataclass(frozen=True, eq=False)
class DesignMatrix:
    """Columns, scaled to a root mean square of 1 over the mask, then whitened; and their sums of products.

    Attributes
    ----------
    problem: what the columns were made from
    groups: which columns enter together
    order: the instants in the order of folds, shape (time,)
    cuts: where each fold begins and ends in that order, shape (fold + 1,)
    readings: where each wheel's readings are in that order, as they followed each other in time; and their runs
    whitening: of the noise
    residual: measured less predicted, whitened, shape (wheel, time), in the order of folds
    energy, counts: sum of squares and number of the residual's readings, shape (fold, wheel)
    scale: what each column was divided by, shape (column,)
    """

    problem: Problem
    groups: tuple[Group, ...]
    order: NDArray[np.int64]
    cuts: NDArray[np.int64]
    readings: tuple[Readings, ...] = field(repr=False)
    whitening: Whitening
    residual: Single
    energy: Array
    counts: Array
    scale: Array
    _storage: _Storage = field(repr=False)

    @property
    def size(self) -> int:
        """Number of columns."""
        return len(self.scale)

    @property
    def columns(self) -> Single:
        """Every column, whitened, shape (column, wheel, time), in the order of folds, 0 outside the mask."""
        return self._storage.columns[: self.size]

    @property
    def gram(self) -> Array:
        """Sums of products of columns, shape (fold, wheel, column, column)."""
        self._sum_products()
        return self._storage.gram[:, :, : self.size, : self.size]

    @property
    def moment(self) -> Array:
        """Sums of products of columns and residual, shape (fold, wheel, column)."""
        self._sum_products()
        return self._storage.moment[:, :, : self.size]

    def whitened(self, values: NDArray[Any], wheels: Sequence[int] | None = None) -> NDArray[Any]:
        """Return readings (…, wheel, time in the order of folds), whitened, of all wheels or of some; 0 elsewhere."""
        return self._of_each_wheel(values, self.whitening.apply, wheels)

    def unwhitened(self, values: NDArray[Any], wheels: Sequence[int] | None = None) -> NDArray[Any]:
        """Return what these whitened readings were."""
        return self._of_each_wheel(values, self.whitening.undo, wheels)

    def in_folds(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return (…, time, wheel) in the order of time as (…, wheel, time in the order of folds)."""
        return np.swapaxes(values, -1, -2)[..., self.order]

    def whitened_in_time(self, values: Array) -> Array:
        """Return readings (…, time, wheel) in the order of time, whitened; 0 without readings."""
        return self.in_time(self.whitened(self.in_folds(values)))

    def whitened_by(self, whitening: Whitening) -> DesignMatrix:
        """Return the same columns under another whitening."""
        storage = _Storage(len(self.cuts) - 1, *self.residual.shape)
        storage.reserve(self.size)
        other = replace(self, whitening=whitening, _storage=storage)
        for chunk in range(0, self.size, CHUNK):
            part = slice(chunk, min(chunk + CHUNK, self.size))
            storage.columns[part] = other.whitened(self.unwhitened(self.columns[part]))
        storage.used = self.size
        residual = other.whitened(self.unwhitened(self.residual))
        return replace(other, residual=residual, energy=_energy(residual, self.cuts))

    def _of_each_wheel(
        self, values: NDArray[Any], what: Callable[..., NDArray[Any]], wheels: Sequence[int] | None
    ) -> NDArray[Any]:
        if self.whitening is NOT_WHITENED:
            return values
        found = np.zeros_like(values)
        for row, wheel in enumerate(range(len(self.readings)) if wheels is None else wheels):
            places, runs = self.readings[wheel]
            found[..., row, places] = what(values[..., row, places], runs)
        return found

    def with_groups(self, groups: Sequence[Group]) -> DesignMatrix:
        """Return the same columns with other groups to choose from."""
        return replace(self, groups=tuple(groups))

    def extended(self, columns: Sequence[Array]) -> tuple[DesignMatrix, tuple[int, ...]]:
        """Return a design matrix with further columns of shape (time, wheel), and their indices."""
        if not len(columns):
            return self, ()
        fresh = _arranged(self.problem, self.order, np.stack(columns))
        energy = np.sum(fresh.astype(np.float64) ** 2, axis=(1, 2))
        scale = np.sqrt(energy / max(int(self.problem.mask.sum()), 1))
        scale = np.where(scale > 0, scale, 1.0)
        fresh = self.whitened(fresh / scale[:, None, None].astype(np.float32))
        storage = self._storage if self._storage.used == self.size else self._storage.branched(self.size)
        storage.reserve(storage.used + len(fresh))
        storage.columns[storage.used : storage.used + len(fresh)] = fresh
        storage.used += len(fresh)
        grown = replace(self, scale=np.concatenate((self.scale, scale)), _storage=storage)
        return grown, tuple(range(self.size, grown.size))

    def _sum_products(self) -> None:
        """Compute the products of the columns that came since the last time with all columns up to them."""
        storage = self._storage
        old, new = storage.summed, storage.used
        if old == new:
            return
        parts = (_folds_of(values, self.cuts) for values in (storage.columns[:new], self.residual))
        for fold, (part, residual) in enumerate(zip(*parts, strict=True)):
            for wheel in range(part.shape[1]):
                before, fresh = part[:old, wheel], part[old:, wheel]
                cross = fresh @ before.T
                storage.gram[fold, wheel, old:new, :old] = cross
                storage.gram[fold, wheel, :old, old:new] = cross.T
                storage.gram[fold, wheel, old:new, old:new] = fresh @ fresh.T
                storage.moment[fold, wheel, old:new] = fresh @ residual[wheel]
        storage.summed = new

    def in_time(self, values: NDArray[Any]) -> Array:
        """Return (…, wheel, time in the order of folds) as (…, time, wheel) in the order of time."""
        restored = np.empty_like(values)
        restored[..., self.order] = values
        return np.swapaxes(restored, -1, -2)


def empty_design(problem: Problem, folds: NDArray[np.int64]) -> DesignMatrix:
    """Return a design matrix without columns; `folds` is each instant's fold, shape (time,)."""
    order = np.argsort(folds, kind="stable")
    cuts = np.searchsorted(folds[order], np.arange(folds.max() + 2))
    residual = _arranged(problem, order, (problem.measured - problem.filled)[None])[0]
    known = _folds_of(problem.mask.T[:, order].astype(np.float64), cuts)
    return DesignMatrix(
        problem=problem,
        groups=(),
        order=order,
        cuts=cuts,
        readings=_readings(problem, order),
        whitening=NOT_WHITENED,
        residual=residual,
        energy=_energy(residual, cuts),
        counts=np.stack([np.sum(part, axis=1) for part in known]),
        scale=np.zeros(0),
        _storage=_Storage(len(cuts) - 1, *residual.shape),
    )


def _energy(residual: Single, cuts: NDArray[np.int64]) -> Array:
    """Return the sum of squares of the residual, shape (fold, wheel)."""
    return np.stack([np.sum(part.astype(np.float64) ** 2, axis=1) for part in _folds_of(residual, cuts)])


def _readings(problem: Problem, order: NDArray[np.int64]) -> tuple[Readings, ...]:
    """Return each wheel's readings: their places in the order of folds, in the order of time, and their runs."""
    place, found = np.argsort(order), []
    for known in problem.mask.T:
        rows = np.flatnonzero(known)
        steps = np.diff(rows)
        usual = float(np.median(steps)) if len(steps) else 1.0
        apart = (np.diff(problem.recording.run[rows]) != 0) | (steps > LONGEST_BRIDGE * usual)
        starts = np.concatenate(([0], 1 + np.flatnonzero(apart), [len(rows)]))
        found.append((place[rows], tuple(slice(int(a), int(b)) for a, b in pairwise(starts) if b > a)))
    return tuple(found)


def _arranged(problem: Problem, order: NDArray[np.int64], values: Array) -> Single:
    """Return (column, time, wheel) as (column, wheel, time) in the order of folds, 0 outside the mask."""
    kept = np.where(problem.mask, values, 0.0)
    return np.ascontiguousarray(np.swapaxes(kept, 1, 2)[:, :, order], dtype=np.float32)


def _folds_of(values: NDArray[Any], cuts: NDArray[np.int64]) -> list[NDArray[Any]]:
    """Return an array's parts along its last axis, one for each fold."""
    return [values[..., a:b] for a, b in pairwise(cuts)]
