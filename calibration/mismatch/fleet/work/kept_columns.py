"""Columns of what each recording shows by itself, kept in a temporary file between the two steps.

They are as long as the recording, and only the second step needs them: memory holds those of the recordings that are
computed at the time, however many there are. They stay with this process, so that workers need no folder in common.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.regression.products.column_file import TemporaryColumns

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.fleet.work.found import Found

BYTES = np.dtype(np.float32).itemsize


class KeptColumns:
    """Takes the columns out of what was found in recordings, and puts them back."""

    def __init__(self) -> None:
        self._file, self._end = TemporaryColumns(), 0
        self._places: dict[str, list[tuple[int, tuple[int, ...]]]] = {}

    def without(self, name: str, found: Found) -> Found:
        """Return what was found in the recording of this name without its columns, which are kept.

        Raises
        ------
        MismatchError
            When the folder for temporary files is full.
        """
        places = self._places[name] = []
        for values in (*(term.columns for term in found.terms), *found.smoothed.values()):
            self._file.write(values, self._end)
            places.append((self._end, values.shape))
            self._end += BYTES * values.size
        return _with(found, [np.zeros((*shape[:-2], 0, 0), np.float32) for _, shape in places])

    def restored(self, name: str, found: Found) -> Found:
        """Return the same with its columns."""
        columns = [np.empty(shape, np.float32) for _, shape in self._places[name]]
        for values, (place, _) in zip(columns, self._places[name], strict=True):
            self._file.fill(values, place)
        return _with(found, columns)


def _with(found: Found, columns: list[np.ndarray[tuple[int, ...], np.dtype[np.float32]]]) -> Found:
    count = len(found.terms)
    terms = tuple(replace(term, columns=values) for term, values in zip(found.terms, columns[:count], strict=True))
    return replace(found, terms=terms, smoothed=dict(zip(found.smoothed, columns[count:], strict=True)))
