"""Sums of products of columns, for each fold and wheel, from columns that are in a file.

A search asks for products of the columns of a few fits with all columns, of every column with itself, and of those in
one group. Of columns that came many at once all products are summed together, in one walk over the file; of later ones,
which are shapes between the points of the grid, only those that are asked for.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.calibration.mismatch.regression.products.column_file import ColumnFile

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Index = NDArray[np.int64]

MANY = 256
"""New columns from which on the products of all columns are summed at once (a choice: the grid, and no proposals)."""
ROWS_AT_ONCE = 4
"""Times as much of columns of which products are asked for as of others is in memory (a choice: the others are read
anew for each part)."""
LONGEST_PART = 8192
"""Instants of all columns that are in memory at once (a choice: about 25 MiB)."""
LONGEST_PIECE = 512
"""Instants that are multiplied at once (a choice: of shorter pieces a product of matrices takes longer for each)."""
ROOM, ROOM_FOR_ROWS = 192, 64
"""Later columns for which room is made at once, and those of them of which products are asked for (a choice: twice
that costs more memory, half of it more time)."""


class Sums:
    """Sums of products of the columns of a file with each other and with a residual, in float32 as the columns are."""

    def __init__(self, columns: ColumnFile, residual: Single, order: Index, cuts: Index, *, searched: bool) -> None:
        """Take columns and residual (wheel, time in the order of folds), that order, and where the folds begin.

        `searched`: whether products of many columns with all others will be asked for, one column after the other.
        """
        self._columns, self._residual, self._order, self._searched = columns, residual, order, searched
        self._folds = [(int(a), int(b)) for a, b in pairwise(cuts)]
        self.forget()

    def forget(self) -> None:
        """Free the memory; what is asked for again is summed again."""
        leading = len(self._folds), self._columns.shape[0]
        self._square: Single = np.zeros((*leading, 0, 0), np.float32)
        self._rank: Index = np.zeros(0, np.int64)
        """Of each column that `_square` has, its row there."""
        self._moment: Array = np.zeros((*leading, 0))
        self._energy: Single = np.zeros((*leading, 0), np.float32)
        self._later: Single = np.zeros((*leading, 0, 0), np.float32)
        self._known: NDArray[np.bool_] = np.zeros((0, 0), np.bool_)
        self._row: Index = np.zeros(0, np.int64)
        """Of each later column, its row in `_later` and `_known`; −1 where its products were never asked for."""
        self._rows = 0
        self._own: dict[tuple[tuple[int, ...], tuple[int, ...]], Array] = {}
        self._precise: dict[tuple[int, ...], tuple[Array, Array]] = {}
        self._summed = 0

    def products(self, rows: Index, columns: Index) -> Single:
        """Return sums of products of columns with others, shape (fold, wheel, row, column)."""
        self._sum_new()
        first = self._square.shape[-1]
        if max(rows.max(initial=0), columns.max(initial=0)) < first:
            return self._square[:, :, self._rank[rows][:, None], self._rank[columns]]
        early, later = np.flatnonzero(rows < first), np.flatnonzero(rows >= first)
        of_early, of_later = np.flatnonzero(columns < first), np.flatnonzero(columns >= first)
        self._sum_later(rows[later], columns)
        self._sum_later(columns[of_later], rows[early])
        found = np.empty((*self._square.shape[:2], len(rows), len(columns)), np.float32)
        found[:, :, later] = self._later[:, :, self._row[rows[later] - first][:, None], columns]
        found[:, :, early[:, None], of_early] = self._square[
            :, :, self._rank[rows[early]][:, None], self._rank[columns[of_early]]
        ]
        mirrored = self._later[:, :, self._row[columns[of_later] - first][:, None], rows[early]]
        found[:, :, early[:, None], of_later] = np.swapaxes(mirrored, 2, 3)
        return found

    def own_products(self, columns: Index, folds: tuple[int, ...]) -> Array:
        """Return sums of products of a few columns with each other over some folds, shape (wheel, row, column).

        They are asked for again and again, and kept.
        """
        key = tuple(columns.tolist()), folds
        if key not in self._own:
            self._sum_new()
            together = columns.max(initial=0) < self._square.shape[-1]
            of_folds = self.products(columns, columns) if together else self._of(self._columns.read(columns), columns)
            self._own[key] = sum((of_folds[fold] for fold in folds), np.zeros(of_folds.shape[1:]))
        return self._own[key]

    def precise(self, columns: Index) -> tuple[Array, Array]:
        """Return sums of products of a few columns with each other, and with the residual.

        Their shapes are (fold, wheel, row, column) and (fold, wheel, column). They are summed in double precision, and
        kept: of columns of which a combination is nearly 0, rounding of single precision would be all that is left.
        """
        key = tuple(columns.tolist())
        if key not in self._precise:
            values = self._columns.read(columns).astype(np.float64)
            residual = self._residual.astype(np.float64)
            parts = [(values[..., a:b], residual[..., a:b]) for a, b in self._folds]
            products = [np.einsum("rwt,cwt->wrc", part, part, optimize=True) for part, _ in parts]
            moments = [np.einsum("cwt,wt->wc", part, of_residual) for part, of_residual in parts]
            self._precise[key] = np.array(products), np.array(moments)
        return self._precise[key]

    def moments(self, columns: Index) -> Array:
        """Return sums of products of columns and residual, shape (fold, wheel, column)."""
        self._sum_new()
        return self._moment[:, :, columns]

    def energies(self, columns: Index) -> Single:
        """Return sums of squares, shape (fold, wheel, column)."""
        self._sum_new()
        return self._energy[:, :, columns]

    def _sum_new(self) -> None:
        """Sum what came since the last time: with all columns, or with the residual and itself where it is little."""
        before, now = self._summed, self._columns.count
        if before == now:
            return
        if self._searched and now - before >= MANY:
            self.forget()
            self._sum_all(now)
        else:
            self._make_room(now)
            at_once = self._columns.at_once
            for first in range(before, now, at_once):
                self._sum_with_residual(np.arange(first, min(first + at_once, now)))
        self._summed = now

    def _sum_with_residual(self, fresh: Index) -> None:
        """Sum the products of new columns with the residual, and their squares."""
        values = self._columns.read(fresh)
        moment, energy = np.empty((2, *self._moment.shape[:2], len(fresh)))
        for fold, (a, b) in enumerate(self._folds):
            for wheel in range(values.shape[1]):
                part = values[:, wheel, a:b]
                moment[fold, wheel] = part @ self._residual[wheel, a:b]
                energy[fold, wheel] = np.einsum("ct,ct->c", part, part)
        self._moment = np.concatenate((self._moment, moment), axis=2)
        self._energy = np.concatenate((self._energy, energy.astype(np.float32)), axis=2)

    def _sum_all(self, count: int) -> None:
        """Sum the products of all columns with each other and with the residual, in one walk over the file.

        What changes at some time is 0 before. Columns are sorted by that, so that those which are not 0 in a piece of
        time are the first ones: only they are multiplied.
        """
        by_begin = np.argsort(self._columns.begins[:count], kind="stable")
        begins, self._rank = self._columns.begins[by_begin], np.argsort(by_begin)
        wheels, instants = self._columns.shape
        self._square = np.zeros((len(self._folds), wheels, count, count), np.float32)
        moment: Array = np.zeros((len(self._folds), wheels, count))
        room: Single = np.empty((count, min(LONGEST_PART, instants)), np.float32)
        for wheel in range(wheels):
            for first in range(0, instants, LONGEST_PART):
                last = min(first + LONGEST_PART, instants)
                part = room[:, : last - first]
                self._columns.read_part(part, by_begin, wheel, first)
                for fold, a, b in self._pieces(first, last):
                    begun = int(np.searchsorted(begins, self._order[b - 1], side="right"))
                    piece = part[:begun, a - first : b - first]
                    self._square[fold, wheel, :begun, :begun] += piece @ piece.T
                    moment[fold, wheel, :begun] += piece @ self._residual[wheel, a:b]
        self._moment = moment[:, :, self._rank]
        self._energy = np.diagonal(self._square, axis1=2, axis2=3)[:, :, self._rank]

    def _pieces(self, first: int, last: int) -> Iterator[tuple[int, int, int]]:
        """Yield pieces between two places in time, each in one fold: its fold, and where it begins and ends."""
        for fold, (begin, end) in enumerate(self._folds):
            low, high = max(begin, first), min(end, last)
            cuts = np.linspace(low, high, -(-(high - low) // LONGEST_PIECE) + 1) if low < high else ()
            yield from ((fold, int(a), int(b)) for a, b in pairwise(cuts))

    def _sum_later(self, later: Index, columns: Index) -> None:
        """Sum the products of later columns with others that are not known yet."""
        if not len(later) or not len(columns):
            return
        self._make_room_for_rows(later)
        unknown = ~self._known[self._row[later - self._square.shape[-1]][:, None], columns]
        rows, others = later[unknown.any(axis=1)], np.unique(columns[unknown.any(axis=0)])
        at_once = self._columns.at_once * ROWS_AT_ONCE
        for first in range(0, len(rows), at_once):
            part = rows[first : first + at_once]
            self._keep(part, others, self._of(self._columns.read(part), others))

    def _of(self, rows: Single, columns: Index) -> Single:
        """Return sums of products of rows (row, wheel, time) with columns of the file."""
        wheels, at_once = self._columns.shape[0], self._columns.at_once
        found = np.empty((len(self._folds), wheels, len(rows), len(columns)), np.float32)
        for first in range(0, len(columns), at_once):
            part = slice(first, first + at_once)
            values = self._columns.read(columns[part])
            for fold, (a, b) in enumerate(self._folds):
                for wheel in range(wheels):
                    found[fold, wheel, :, part] = rows[:, wheel, a:b] @ values[:, wheel, a:b].T
        return found

    def _keep(self, rows: Index, columns: Index, values: Single) -> None:
        """Keep products of later columns, in the rows of both where the others have one too."""
        first = self._square.shape[-1]
        at, later = self._row[rows - first], np.flatnonzero(columns >= first)
        self._later[:, :, at[:, None], columns] = values
        self._known[at[:, None], columns] = True
        mirrored = self._row[columns[later] - first]
        later, mirrored = later[mirrored >= 0], mirrored[mirrored >= 0]
        self._later[:, :, mirrored[:, None], rows] = np.swapaxes(values[:, :, :, later], 2, 3)
        self._known[mirrored[:, None], rows] = True

    def _make_room(self, count: int) -> None:
        """Make room for later columns, up to so many columns in all."""
        later = count - self._square.shape[-1]
        if later > len(self._row):
            self._row = np.concatenate((self._row, np.full(later + ROOM - len(self._row), -1)))
        if count > self._known.shape[1]:
            self._grow(len(self._known), count + ROOM)

    def _make_room_for_rows(self, later: Index) -> None:
        """Make room for the products of later columns that were not asked for before."""
        places = later - self._square.shape[-1]
        fresh = np.unique(places[self._row[places] < 0])
        self._row[fresh] = self._rows + np.arange(len(fresh))
        self._rows += len(fresh)
        if self._rows > len(self._known):
            self._grow(self._rows + ROOM_FOR_ROWS, self._known.shape[1])

    def _grow(self, rows: int, columns: int) -> None:
        """Give the products of later columns so many rows and columns."""
        kept = tuple(slice(0, size) for size in self._known.shape)
        grown: Single = np.zeros((*self._square.shape[:2], rows, columns), np.float32)
        grown[(slice(None), slice(None), *kept)] = self._later
        known = np.zeros((rows, columns), np.bool_)
        known[kept] = self._known
        self._later, self._known = grown, known
