"""Where something is so for readings that follow each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def stretches(where: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first reading of each stretch in which it is true, and the one after its last; `where` is (time,)."""
    edges = np.flatnonzero(np.diff(where, prepend=False, append=False))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
