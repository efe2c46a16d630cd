"""Arrays that were computed last, up to a size in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

Array = NDArray[np.float64]

MOST_BYTES = 16_000_000
"""What is kept (a choice: 160 columns of 12 000 readings; a search for a shape that is repeated beside other terms asks
for two thirds of them again)."""


class RecentArrays:
    """A cache that forgets first what was not asked for longest."""

    def __init__(self) -> None:
        self._kept: dict[tuple[int, Hashable], tuple[object, Array]] = {}
        self._bytes = 0

    def get(self, of: object, name: Hashable, derive: Callable[[], Array]) -> Array:
        """Return what has this name of an object, which is compared by identity; read-only, since it is shared."""
        key = id(of), name
        found = self._kept.pop(key, None)
        if found is None:
            array = derive()
            array.setflags(write=False)
            self._bytes += array.nbytes
            while self._kept and self._bytes > MOST_BYTES:
                self._bytes -= self._kept.pop(next(iter(self._kept)))[1].nbytes
            found = of, array  # the object is kept so that no other one gets its identity
        self._kept[key] = found
        return found[1]
