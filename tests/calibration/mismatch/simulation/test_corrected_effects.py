"""The effects that a corrected SIM.toml states."""

from __future__ import annotations

from typing import Any

import pytest

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.simulation.corrected_effects import stated_effects

EFFECT: dict[str, Any] = {"name": "viscous-friction", "shape": {}, "coefficients": [1], "wheels": [1, "left"]}


def test_an_effect_is_read_with_its_wheels_as_they_are_named() -> None:
    """Numbers and names; without an uncertainty it is exact, without a channel it is of the only one."""
    (found,) = stated_effects({"effects": [EFFECT]})
    assert (found.name, found.shape, found.coefficients, found.wheels) == ("viscous-friction", {}, (1.0,), (1, "left"))
    assert (found.relative_std, found.channel) == (0.0, "")
    assert stated_effects({}) == ()


@pytest.mark.parametrize("number", [1, 2])
def test_an_effect_that_lacks_something_is_told_by_its_number(number: int) -> None:
    """The first is effect 1."""
    broken = {key: value for key, value in EFFECT.items() if key != "wheels"}
    effects = [*[EFFECT] * (number - 1), broken]
    with pytest.raises(
        SimulationError, match=rf"^effect {number} needs name, shape, coefficients and wheels: 'wheels'"
    ):
        stated_effects({"effects": effects})
