"""Columns in a temporary file: the memory of a comparison does not hold a number for each reading and column.

A library makes about a thousand columns, so that they are a hundred times the recording. Each is written once, and read
a few times: all of them for their sums of products, single ones where a fit needs them. They are not computed anew
instead, since a candidate's columns may cost runs of the user's simulation. The file is read, not mapped: mapped pages
would count as memory of the process. It has no name, and is gone with the process, whatever ends it.
"""

from __future__ import annotations

import os
import tempfile
import weakref
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import MismatchError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

Single = NDArray[np.float32]
Index = NDArray[np.int64]

AT_ONCE_BYTES = 4 * 2**20
"""Bytes of columns that are in memory at once, at most (a choice: much longer pieces are no quicker)."""


class TemporaryColumns:
    """A temporary file of numbers in single precision; places in it are in bytes."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="regolithd-", buffering=0)  # noqa: SIM115  # closed below
        weakref.finalize(self, self._file.close)

    def write(self, values: Single, offset: int) -> None:
        """Write an array at a place.

        Raises
        ------
        MismatchError
            When the folder for temporary files is full.
        """
        left = np.ascontiguousarray(values, np.float32).reshape(-1).data.cast("B")
        try:
            while left:
                written = os.pwrite(self._file.fileno(), left, offset)
                left, offset = left[written:], offset + written
        except OSError as error:
            raise MismatchError(
                f"columns of a comparison do not fit into {tempfile.gettempdir()} ({error.strerror}); "
                "set TMPDIR to a folder with more room"
            ) from error

    def fill(self, values: Single, offset: int) -> None:
        """Fill an array that is contiguous with what was written from a place on."""
        left = values.reshape(-1).data.cast("B")
        while left:
            read = os.preadv(self._file.fileno(), [left], offset)
            left, offset = left[read:], offset + read


class ColumnFile:
    """Columns of one recording, of shape (wheel, time), which can be appended and read.

    Attributes
    ----------
    shape: of one column
    count: of columns
    begins: each column's first instant that is not 0 on every wheel, shape (column,)
    """

    def __init__(self, wheels: int, instants: int) -> None:
        self.shape, self.count = (wheels, instants), 0
        self.begins: Index = np.zeros(0, np.int64)
        self._file = TemporaryColumns()

    @property
    def at_once(self) -> int:
        """How many columns may be in memory at once: at least one."""
        return max(AT_ONCE_BYTES // max(self._column_bytes, 1), 1)

    @property
    def _column_bytes(self) -> int:
        return 4 * self.shape[0] * self.shape[1]

    def append(self, columns: Single, begins: Index) -> None:
        """Write further columns, shape (column, wheel, time), with the first instants at which they are not 0.

        Raises
        ------
        MismatchError
            When the folder for temporary files is full.
        """
        self._file.write(columns, self.count * self._column_bytes)
        self.count += len(columns)
        self.begins = np.concatenate((self.begins, begins))

    def read(self, at: Sequence[int] | Index) -> Single:
        """Return some columns, shape (column, wheel, time)."""
        found = np.empty((len(at), *self.shape), np.float32)
        for first, last in _adjacent(at):
            self._file.fill(found[first:last], int(at[first]) * self._column_bytes)
        return found

    def read_part(self, found: Single, at: Sequence[int] | Index, wheel: int, first: int) -> None:
        """Fill an array (column, time) with some columns on a wheel, from a place in time on."""
        for row, column in zip(found, at, strict=True):
            self._file.fill(row, int(column) * self._column_bytes + 4 * (wheel * self.shape[1] + first))


def _adjacent(at: Sequence[int] | Index) -> Iterator[tuple[int, int]]:
    """Yield the stretches of places that follow each other: from where, to before where."""
    ends = [*(np.flatnonzero(np.diff(np.asarray(at)) != 1) + 1).tolist(), len(at)]
    first = 0
    for last in ends:
        if last > first:
            yield first, last
        first = last
