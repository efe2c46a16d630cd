"""The effects that a corrected SIM.toml states."""

from __future__ import annotations

from typing import Any

import pytest

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.corrections.onset_clock import FoundIn
from regolithd.calibration.mismatch.problem.corrections.size_posterior import SizePosterior
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


@pytest.mark.parametrize(
    "shape_std", [{"pover": 0.1}, {"fades": 0.1}, {"power": "wide"}, {"power": float("nan")}, {"power": -0.1}, 0.1]
)
def test_a_deviation_of_no_number_of_the_law_is_told(shape_std: object) -> None:
    """Misspelt, of a choice, or no standard deviation itself."""
    effect = {**EFFECT, "shape": {"power": 0.9, "fades": "quotient"}, "shape_std": shape_std}
    with pytest.raises(SimulationError, match=r"^effect 1 needs"):
        stated_effects({"effects": [effect]})
    (found,) = stated_effects({"effects": [{**effect, "shape_std": {"power": 0.1}}]})
    assert found.shape_std == {"power": 0.1}


@pytest.mark.parametrize(
    "found_in", [{"digest": "8d", "instants": 9}, "yesterday", {"digest": "8d", "instants": "", "end_s": 1}]
)
def test_the_recording_that_an_onset_is_of_is_read_whole(found_in: object) -> None:
    """By its digest, its length and its end; without it the onset is on each recording's own clock."""
    with pytest.raises(SimulationError, match=r"^effect 1 needs .*: found_in has digest, instants and end_s"):
        stated_effects({"effects": [{**EFFECT, "found_in": found_in}]})
    whole = {"digest": "8d", "instants": 9, "end_s": 4}
    (found,) = stated_effects({"effects": [{**EFFECT, "found_in": whole}]})
    assert found.found_in == FoundIn("8d", 9, 4.0)
    assert stated_effects({"effects": [EFFECT]})[0].found_in is None


POSTERIOR: dict[str, Any] = {"parameters": ["gain"], "values": [2], "covariance": [[0.04, -0.01], [-0.01, 0.01]]}


def test_a_posterior_is_of_named_parameters_and_the_size() -> None:
    """Its covariance has a row for each parameter, and one for the size."""
    (found,) = stated_effects({"effects": [{**EFFECT, "posterior": POSTERIOR}]})
    assert found.posterior == SizePosterior(("gain",), (2.0,), ((0.04, -0.01), (-0.01, 0.01)))
    assert stated_effects({"effects": [EFFECT]})[0].posterior is None


@pytest.mark.parametrize(
    "broken",
    [
        {"values": []},
        {"values": ["two"]},
        {"values": [float("nan")]},
        {"covariance": [[0.04]]},
        {"covariance": [[0.04, -0.01], [-0.01]]},
        {"covariance": [[0.04, -0.01], [0.01, 0.01]]},
        {"covariance": [[0.04, -0.03], [-0.03, 0.01]]},
        {"covariance": [[0.0, 0.0], [0.0, 0.01]]},
    ],
)
def test_a_posterior_that_is_none_is_told(broken: dict[str, Any]) -> None:
    """Of another length, no number, not symmetric, or not positive definite."""
    effect = {**EFFECT, "posterior": {**POSTERIOR, **broken}}
    with pytest.raises(SimulationError, match=r"^effect 1 needs .*posterior has parameters, values and covariance"):
        stated_effects({"effects": [effect]})
    with pytest.raises(SimulationError, match=r"^effect 1 needs .*posterior has parameters, values and covariance"):
        stated_effects({"effects": [{**EFFECT, "posterior": "known"}]})
