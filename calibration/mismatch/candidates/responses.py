"""What a residual has of shapes that mean the same in every recording of a machine, so that it adds up over them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Responses:
    """Products of a residual with the columns that some shapes have on each wheel, over the noise's variance there.

    Attributes
    ----------
    shapes: of each response, shapes whose first columns it is of: a sine, and the same with an overtone
    wheels: names
    moment: shape (response, wheel, column)
    energy: mean sum of squares of these columns, shape (response, wheel); 0 where a recording cannot tell
    """

    shapes: tuple[tuple[dict[str, float | str], ...], ...]
    wheels: tuple[int | str, ...]
    moment: Array
    energy: Array


def strongest(responses: Sequence[Responses], rovers: Sequence[int | str], most: int) -> list[int]:
    """Return the places of the strongest responses that some recording can tell, best first.

    Each is that of all rovers, of one, or of one wheel of one, whichever is strongest. `rovers` tells whose each
    recording is. The wheels of a rover have coefficients of their own, which are the same in all of its recordings; a
    response is ranked by Δχ² less two for each coefficient (Akaike's information criterion).
    """
    moments: dict[tuple[int | str, int | str], Array] = {}
    energies: dict[tuple[int | str, int | str], Array] = {}
    for rover, each in zip(rovers, responses, strict=True):
        for k, wheel in enumerate(each.wheels):
            key = rover, wheel
            moments[key] = moments.get(key, np.zeros(())) + each.moment[:, k]
            energies[key] = energies.get(key, np.zeros(())) + each.energy[:, k]
    ahead = {
        key: np.sum(moments[key] ** 2, axis=1) / np.maximum(energy, 1e-300) - 2 * moments[key].shape[1]
        for key, energy in energies.items()
    }
    of_rovers = [sum(one for key, one in ahead.items() if key[0] == rover) for rover in dict.fromkeys(rovers)]
    best = np.max([*ahead.values(), *of_rovers, sum(of_rovers)], axis=0)
    told = np.max(list(energies.values()), axis=0) > 0
    return [int(place) for place in np.argsort(-best, kind="stable") if told[place]][:most]
