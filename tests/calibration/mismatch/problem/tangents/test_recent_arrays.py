"""Arrays that were computed last, up to a size in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.mismatch.problem.tangents import recent_arrays
from regolithd.calibration.mismatch.problem.tangents.recent_arrays import RecentArrays

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


def counted(made: list[float], value: float) -> Callable[[], NDArray[np.float64]]:
    """Return what derives two numbers of 8 bytes, and says so."""

    def derive() -> NDArray[np.float64]:
        made.append(value)
        return np.full(2, value)

    return derive


def test_what_was_not_asked_for_longest_is_forgotten_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of four arrays in memory for three, the one that was asked for again stays."""
    monkeypatch.setattr(recent_arrays, "MOST_BYTES", 48)
    arrays, made = RecentArrays(), list[float]()
    for value in (1.0, 2.0, 3.0, 1.0, 4.0, 1.0, 2.0):
        assert arrays.get(None, value, counted(made, value)).tolist() == [value, value]
    assert made == [1.0, 2.0, 3.0, 4.0, 2.0]


def test_names_are_those_of_an_object() -> None:
    """Two lists that are equal are two objects."""
    arrays, made, one, other = RecentArrays(), list[float](), [0], [0]
    assert arrays.get(one, "size", counted(made, 1.0))[0] == 1.0
    assert arrays.get(other, "size", counted(made, 2.0))[0] == 2.0
    assert arrays.get(one, "size", counted(made, 3.0))[0] == 1.0


def test_what_is_shared_cannot_be_written() -> None:
    """Whoever asks for it gets the same array."""
    arrays = RecentArrays()
    with pytest.raises(ValueError, match="read-only"):
        arrays.get(None, "size", lambda: np.zeros(2))[:] = 1.0
