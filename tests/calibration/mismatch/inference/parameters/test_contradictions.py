"""Channels of one machine that contradict each other about the parameters that they share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.inference.parameters.contradictions import contradictions
from regolithd.calibration.mismatch.inference.parameters.joint_parameters import Information

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.answer import Answer

PRIORS = {"a": Prior(10.0, 1.0), "b": Prior(1.0, 0.1)}


def seen(a: float, b: float, std: float = 0.05) -> Information:
    """Return what a channel says that has seen both parameters."""
    matrix = np.diag([1.0, 100.0]) / std**2
    return Information(("a", "b"), matrix, matrix @ [a, b], {})


def test_channels_that_agree_contradict_nothing() -> None:
    """Within chance, and however far from the priors both are."""
    assert not contradictions(PRIORS, {"force": seen(10.5, 1.02), "power": seen(10.4, 1.02)})
    assert not contradictions(PRIORS, {"force": seen(14.0, 1.4), "power": seen(14.0, 1.4)})


def test_the_channel_that_the_priors_contradict_more_comes_first() -> None:
    """Of two either may be wrong; one parameter is 1.5 deviations from its prior in one, and as stated in the other."""
    first, second = contradictions(PRIORS, {"force": seen(8.5, 1.0), "power": seen(10.0, 1.0)})
    assert (first.channel, second.channel) == ("force", "power")
    assert first.gain == pytest.approx(second.gain)
    assert first.evidence - second.evidence == pytest.approx(1.5**2, rel=0.01)
    known = first.known(PRIORS)
    assert dict(zip(known.names, known.mean, strict=True))["a"] == pytest.approx(10.0, abs=0.01)


def test_of_three_it_is_the_one_that_two_contradict() -> None:
    """Without one of the two the contradiction stays."""
    channels = {"force": seen(8.5, 1.0), "power": seen(10.0, 1.0), "current": seen(10.0, 1.0)}
    assert [each.channel for each in contradictions(PRIORS, channels)] == ["force"]


def test_one_channel_alone_contradicts_nothing() -> None:
    """The others leave something unexplained; and none contradicts another about parameters that are exact."""
    exact = {"a": Prior(10.0), "b": Prior(1.0)}
    assert not contradictions(PRIORS, {"force": seen(8.5, 1.0)})
    assert not contradictions(exact, {"force": seen(8.5, 1.0), "power": seen(10.0, 1.0)})


def test_what_the_others_know_of_two_that_they_cannot_tell_apart_is_a_density() -> None:
    """They know the sum alone, many thousand times as well as the priors do."""
    matrix = np.full((2, 2), 1e9) * np.outer([1.0, 10.0], [1.0, 10.0])
    others = Information(("a", "b"), matrix, matrix @ [10.0, 1.0], {})
    found = contradictions(PRIORS, {"force": seen(8.0, 1.0), "power": others})
    known = next(each for each in found if each.channel == "force").known(PRIORS)
    assert np.isfinite(known.factor).all()
    assert (np.diag(known.factor) > 0).all()
    values = known.values(dict(zip(known.names, known.mean + np.array([0.3, 0.0]), strict=True)))
    assert values["a"] / 10 + values["b"] == pytest.approx(2.0, abs=1e-4)


class Fan(Simulation):
    """The pressure of a fan and the power of its motor."""

    channels: ClassVar = {"pressure_Pa": "Pa", "power_W": "W"}
    inputs = ("speed_rad_s", "flow_m3_s")
    parameters: ClassVar = {
        "per_speed2": Prior(0.02, 0.0012, "Pa s²"),
        "per_flow2": Prior(30.0, 1.5, "Pa s²/m⁶"),
        "idle_W": Prior(40.0, 3.0, "W"),
    }

    def predict(self, inputs: Mapping[str, Any], values: Mapping[str, float]) -> Any:
        """Return the pressure, and the power that moves the air with it."""
        speed, flow = inputs["speed_rad_s"], inputs["flow_m3_s"]
        pressure = values["per_speed2"] * speed**2 - values["per_flow2"] * flow**2
        return {"pressure_Pa": pressure, "power_W": flow * pressure + values["idle_W"]}

    def covariates(self, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """Return speed and flow."""
        return {"wheel_speed": inputs["speed_rad_s"], "flow": inputs["flow_m3_s"]}


def answer(seed: int, gains: tuple[float, float] = (1.0, 1.0)) -> Answer:
    """Compare with a fan whose pressure and power are read with these gains."""
    random, time_s = np.random.default_rng(seed), 0.5 * np.arange(2400)
    speed = 210 + 45 * np.sin(time_s / 37 + seed) + 15 * np.sin(time_s / 11)
    flow = 1.8 + 0.6 * np.sin(time_s / 53 - seed) + 0.3 * np.sin(time_s / 17)
    pressure = 0.0203 * speed**2 - 29.5 * flow**2
    columns = {
        "t_s": time_s,
        "pressure_Pa": gains[0] * pressure + random.normal(0, 15.0, len(time_s)),
        "power_W": gains[1] * (flow * pressure + 41.0) + random.normal(0, 35.0, len(time_s)),
        "speed_rad_s": speed,
        "flow_m3_s": flow,
    }
    return compare(from_columns(columns), Fan()).answer


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_right_channels_are_consistent(seed: int) -> None:
    """Nothing is told, and no note of a contradiction."""
    found = answer(seed)
    assert found.verdict == "consistent"
    assert not any("contradicts" in note for note in found.notes)


@pytest.mark.parametrize(("gains", "wrong"), [((0.92, 1.0), "pressure_Pa"), ((1.0, 1.09), "power_W")])
def test_a_gain_of_one_channel_is_told_there(gains: tuple[float, float], wrong: str) -> None:
    """Each by itself has it within the priors of its parameters; they are those of the other channel in the answer."""
    found = answer(4, gains)
    assert not found.unexplained
    assert [(each.name, each.channel) for each in found.effects] == [("load-dependent-efficiency", wrong)]
    assert any(note.startswith(f"{wrong} contradicts ") for note in found.notes)
    held = [each for each in found.parameters if each.name != "idle_W"]
    truth = {"per_speed2": 0.0203, "per_flow2": 29.5}
    assert all(abs(each.value - truth[each.name]) < 2.5 * (each.high - each.low) / 2 / 1.645 for each in held)
