"""The design matrix: every column of every group, with sums of products for each wheel and each fold.

A term on any set of wheels, fitted on any set of folds, needs only those sums; memory does not hold the columns
(`regression.column_file`). A design matrix is immutable; `extended` returns one with further columns.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.regression.products.column_file import ColumnFile
from regolithd.calibration.mismatch.regression.products.sums import Sums
from regolithd.calibration.mismatch.signal.noise_models.whitening import NOT_WHITENED, Whitening

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.problem.problem import Problem, Readings
    from regolithd.calibration.mismatch.regression.group import Group

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Index = NDArray[np.int64]

LEAST_SCALE = float(np.finfo(np.float32).tiny)
"""Root mean square below which a column is one of zeros: it cannot be divided by in single precision."""


@dataclass(frozen=True, eq=False)
class Reliability:
    """By what readings are multiplied to scatter alike, shape (wheel, time in the order of folds) each.

    Attributes
    ----------
    alone: each reading by itself
    in_means: so that a mean of many readings is as uncertain as it is: errors that wheels have in common, or that last,
        do not average out
    """

    alone: Single
    in_means: Single


@dataclass(frozen=True, eq=False)
class Course:
    """The compared readings of some wheels in one course: one wheel after the other, each in the order of time.

    Attributes
    ----------
    wheel: of each reading, shape (reading,)
    place: of each reading in the order of folds
    in_time, in_folds: of each reading in an array (time, wheel), and in one (wheel, time in the order of folds)
    runs: which readings followed each other
    whitening: of the noise
    reliability: of each reading, by which it is multiplied before it is whitened; None: all are alike
    """

    wheel: Index
    place: Index
    in_time: Index
    in_folds: Index
    runs: tuple[slice, ...]
    whitening: Whitening
    reliability: Single | None = None

    def whitened(self, columns: Array) -> Single:
        """Return columns (column, time, wheel), whitened, shape (column, reading)."""
        values = np.take(columns.reshape(len(columns), -1), self.in_time, axis=1).astype(np.float32)
        if self.reliability is not None:
            values *= self.reliability
        return values if self.whitening is NOT_WHITENED else self.whitening.apply(values, self.runs)

    def arranged(self, values: Single) -> Single:
        """Return what is in the order of folds (…, wheel, time) as (…, reading)."""
        return np.take(values.reshape(*values.shape[:-2], -1), self.in_folds, axis=-1)


@dataclass(frozen=True, eq=False)
class DesignMatrix:
    """Columns, scaled to a root mean square of 1 over the mask, as read and whitened; and their sums of products.

    Attributes
    ----------
    problem: what the columns were made from
    groups: which columns enter together
    order: the instants in the order of folds, shape (time,)
    cuts: where each fold begins and ends in that order, shape (fold + 1,)
    readings: where each wheel's readings are in that order, as they followed each other in time; and their runs
    whitening: of the noise
    reliability: of the readings, which are multiplied by that in means before they are whitened; None: all are alike
    residual_as_read: measured less predicted, shape (wheel, time), in the order of folds, 0 outside the mask
    residual: the same, whitened
    energy, counts: sum of squares and number of the whitened residual's readings, shape (fold, wheel)
    scale: what each column was divided by, shape (column,)
    """

    problem: Problem
    groups: tuple[Group, ...]
    order: Index
    cuts: Index
    readings: tuple[Readings, ...] = field(repr=False)
    whitening: Whitening
    residual_as_read: Single
    residual: Single
    energy: Array
    counts: Array
    scale: Array
    _places: Index = field(repr=False)
    """Of each column in the files, which matrices that were extended from one have in common."""
    _as_read: ColumnFile = field(repr=False)
    _whitened: ColumnFile = field(repr=False)
    """The same file where nothing is whitened."""
    _sums: Sums = field(repr=False)
    reliability: Reliability | None = field(default=None, repr=False)

    @property
    def size(self) -> int:
        """Number of columns."""
        return len(self.scale)

    @property
    def folds(self) -> int:
        """Number of folds."""
        return len(self.cuts) - 1

    def columns(self, at: Sequence[int] | Index) -> Single:
        """Return some columns, whitened, shape (column, wheel, time), in the order of folds, 0 outside the mask."""
        self._whiten_new()
        return self._whitened.read(self._places[np.asarray(at, np.int64)])

    def columns_as_read(self, at: Sequence[int] | Index) -> Single:
        """Return the same columns, not whitened."""
        return self._as_read.read(self._places[np.asarray(at, np.int64)])

    def products(self, rows: Sequence[int] | Index, columns: Sequence[int] | Index) -> Single:
        """Return sums of products of some columns with others, shape (fold, wheel, row, column)."""
        self._whiten_new()
        at = (self._places[np.asarray(each, np.int64)] for each in (rows, columns))
        return self._sums.products(*at)

    def own_products(self, columns: Sequence[int], folds: Sequence[int]) -> Array:
        """Return sums of products of a group's columns with each other over some folds, shape (wheel, row, column)."""
        self._whiten_new()
        return self._sums.own_products(self._places[list(columns)], tuple(folds))

    def precise_sums(self, columns: Sequence[int]) -> tuple[Array, Array]:
        """Return sums of products of a few columns with each other and with the residual, in double precision.

        Their shapes are (fold, wheel, row, column) and (fold, wheel, column).
        """
        self._whiten_new()
        return self._sums.precise(self._places[np.asarray(columns, np.int64)])

    def energies(self, columns: Sequence[int] | Index) -> Single:
        """Return sums of squares of some columns, shape (fold, wheel, column)."""
        self._whiten_new()
        return self._sums.energies(self._places[np.asarray(columns, np.int64)])

    @property
    def moment(self) -> Array:
        """Sums of products of columns and residual, shape (fold, wheel, column)."""
        self._whiten_new()
        return self._sums.moments(self._places)

    def whitened(self, values: NDArray[Any], wheels: Sequence[int] | None = None) -> NDArray[Any]:
        """Return readings (…, wheel, time in the order of folds), whitened, of all wheels or of some; 0 elsewhere."""
        on = range(len(self.readings)) if wheels is None else wheels
        if self.reliability is not None:
            values = values * self.reliability.in_means[list(on)]
        if self.whitening is NOT_WHITENED:
            return values
        found, flat = np.zeros_like(values), values.reshape(*values.shape[:-2], -1)
        for row, wheel in enumerate(on):
            places, runs = self.readings[wheel]
            # Of several axes, `take` is quicker than an index, and an index of each column than of all.
            white = self.whitening.apply(np.take(flat, row * values.shape[-1] + places, axis=-1), runs)
            for column in np.ndindex(white.shape[:-1]):
                found[(*column, row)][places] = white[column]
        return found

    def course_of(self, wheels: Sequence[int]) -> Course:
        """Return the compared readings of some wheels in one course."""
        on, runs, before = [self.readings[wheel] for wheel in wheels], [], 0
        for places, of_wheel in on:
            runs += [slice(run.start + before, run.stop + before) for run in of_wheel]
            before += len(places)
        place = np.concatenate([places for places, _ in on])
        wheel = np.repeat(np.asarray(wheels, np.int64), [len(places) for places, _ in on])
        in_time = self.order[place] * len(self.readings) + wheel
        reliability = None if self.reliability is None else self.reliability.in_means[wheel, place]
        return Course(wheel, place, in_time, wheel * len(self.order) + place, tuple(runs), self.whitening, reliability)

    def in_folds(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return (…, time, wheel) in the order of time as (…, wheel, time in the order of folds)."""
        return np.swapaxes(values, -1, -2)[..., self.order]

    def in_time(self, values: NDArray[Any]) -> Array:
        """Return (…, wheel, time in the order of folds) as (…, time, wheel) in the order of time."""
        restored = np.empty_like(values)
        restored[..., self.order] = values
        return np.swapaxes(restored, -1, -2)

    def whitened_in_time(self, values: Array) -> Array:
        """Return readings (…, time, wheel) in the order of time, whitened; 0 without readings."""
        return self.in_time(self.whitened(self.in_folds(values)))

    def whitened_by(self, whitening: Whitening, reliability: Reliability | None = None) -> DesignMatrix:
        """Return the same columns under another whitening and reliability; the sums under these are not kept."""
        self._sums.forget()
        same = whitening is NOT_WHITENED and reliability is None
        file = self._as_read if same else ColumnFile(*self._as_read.shape)
        other = replace(self, whitening=whitening, reliability=reliability, _whitened=file)
        residual = other.whitened(self.residual_as_read)
        sums = Sums(file, residual, self.order, self.cuts, searched=True)
        return replace(other, residual=residual, energy=_energy(residual, self.cuts), _sums=sums)

    def with_groups(self, groups: Sequence[Group]) -> DesignMatrix:
        """Return the same columns with other groups to choose from."""
        return replace(self, groups=tuple(groups))

    def extended(self, columns: Sequence[Array]) -> tuple[DesignMatrix, tuple[int, ...]]:
        """Return a design matrix with further columns of shape (time, wheel), and their indices."""
        if not len(columns):
            return self, ()
        fresh = _arranged(self.problem, self.order, columns)
        energy = np.array([np.sum(column.astype(np.float64) ** 2) for column in fresh])
        scale = np.sqrt(energy / max(int(self.problem.mask.sum()), 1))
        fresh[scale < LEAST_SCALE] = 0.0
        scale = np.where(scale >= LEAST_SCALE, scale, 1.0)
        fresh /= scale[:, None, None].astype(np.float32)
        places = np.arange(self._as_read.count, self._as_read.count + len(fresh))
        self._as_read.append(fresh, _begins(fresh, self.order))
        grown = replace(self, scale=np.concatenate((self.scale, scale)), _places=np.concatenate((self._places, places)))
        return grown, tuple(range(self.size, grown.size))

    def _whiten_new(self) -> None:
        """Whiten the columns that came since the last time."""
        as_read, whitened = self._as_read, self._whitened
        while whitened.count < as_read.count:
            first = whitened.count
            part = np.arange(first, min(first + as_read.at_once, as_read.count))
            whitened.append(self.whitened(as_read.read(part)), as_read.begins[part])


def empty_design(problem: Problem, folds: Index) -> DesignMatrix:
    """Return a design matrix without columns; `folds` is each instant's fold, shape (time,)."""
    order = np.argsort(folds, kind="stable")
    cuts = np.searchsorted(folds[order], np.arange(folds.max() + 2))
    residual = _arranged(problem, order, [problem.residual])[0]
    known = _folds_of(problem.mask.T[:, order].astype(np.float64), cuts)
    columns = ColumnFile(*residual.shape)
    return DesignMatrix(
        problem=problem,
        groups=(),
        order=order,
        cuts=cuts,
        readings=_readings(problem, order),
        whitening=NOT_WHITENED,
        residual_as_read=residual,
        residual=residual,
        energy=_energy(residual, cuts),
        counts=np.stack([np.sum(part, axis=1) for part in known]),
        scale=np.zeros(0),
        _places=np.zeros(0, np.int64),
        _as_read=columns,
        _whitened=columns,
        _sums=Sums(columns, residual, order, cuts, searched=False),
    )


def _energy(residual: Single, cuts: Index) -> Array:
    """Return the sum of squares of the residual, shape (fold, wheel)."""
    return np.stack([np.sum(part.astype(np.float64) ** 2, axis=1) for part in _folds_of(residual, cuts)])


def _readings(problem: Problem, order: Index) -> tuple[Readings, ...]:
    """Return each wheel's readings: their places in the order of folds, in the order of time, and their runs."""
    place = np.argsort(order)
    return tuple((place[rows], runs) for rows, runs in problem.courses)


def _arranged(problem: Problem, order: Index, columns: Sequence[Array]) -> Single:
    """Return columns (time, wheel) as (column, wheel, time) in the order of folds, 0 outside the mask."""
    wheels = problem.mask.shape[1]
    found: Single = np.empty((len(columns), wheels, len(order)), np.float32)
    in_time = order * wheels + np.arange(wheels)[:, None]
    for row, column in zip(found, columns, strict=True):
        row[:] = np.take(np.where(problem.mask, column, 0.0).astype(np.float32), in_time)
    return found


def _begins(columns: Single, order: Index) -> Index:
    """Return the first instant at which a column (wheel, time in the order of folds) is not 0, shape (column,).

    What is whitened later is 0 until then as well.
    """
    acting = columns.any(axis=1)
    return np.asarray(np.min(np.where(acting, order, len(order)), axis=1), np.int64)


def _folds_of(values: NDArray[Any], cuts: Index) -> list[NDArray[Any]]:
    """Return an array's parts along its last axis, one for each fold."""
    return [values[..., a:b] for a, b in pairwise(cuts)]
