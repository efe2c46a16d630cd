"""Thrust and torque of a propeller, predicted at once: each with its own unit, noise and findings."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest
from sample_answer import ANSWER

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.answer import Answer, CalibratedParameter, FitImprovement, OtherAnswer
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.errors import MismatchError, SimulationError
from regolithd.calibration.mismatch.inference.several_channels import (
    no_surer_than_before,
    notes_of,
    priors_from_others,
)
from regolithd.calibration.mismatch.signal.normal_interval import std_of_interval
from regolithd.calibration.mismatch.simulation.checked import checked

if TYPE_CHECKING:
    from collections.abc import Mapping


class Propeller(Simulation):
    """Thrust and torque with the square of the speed."""

    channels: ClassVar = {"thrust_N": "N", "torque_Nm": "N·m"}
    inputs = ("speed_rad_s",)
    parameters: ClassVar = {"thrust": Prior(1.2e-5, 5e-7), "torque": Prior(2.0e-7, 8e-9)}

    def predict(self, inputs: Mapping[str, Any], values: Mapping[str, float]) -> Any:
        """Return both channels by name."""
        square = inputs["speed_rad_s"] * np.abs(inputs["speed_rad_s"])
        return {"thrust_N": values["thrust"] * square, "torque_Nm": values["torque"] * square}

    def covariates(self, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """Return speed and time."""
        return {"wheel_speed": inputs["speed_rad_s"], "time": inputs["t_s"]}


def spun(drag_Nm: float = 0.0) -> Recording:
    """Return four minutes of a propeller that reverses, with a drag of its bearing in the torque alone."""
    generator, time_s = np.random.default_rng(5), 0.1 * np.arange(2400)
    speed = 900 * np.sin(time_s / 9) + 300 * np.sin(time_s / 2.3)
    square = speed * np.abs(speed)
    thrust = 1.22e-5 * square + generator.normal(0, 0.5, len(time_s))
    torque = 2.02e-7 * square + drag_Nm * np.sign(speed) + generator.normal(0, 0.008, len(time_s))
    return from_columns({"t_s": time_s, "thrust_N": thrust, "torque_Nm": torque, "speed_rad_s": speed})


def test_nothing_is_missing_in_either_channel() -> None:
    """Newtons of thrust are no outliers of newton metres of torque: nothing is left out."""
    answer = compare(spun(), Propeller()).answer
    assert answer.verdict == "consistent"
    assert not answer.left_out


def test_an_effect_is_told_in_its_channel_and_unit() -> None:
    """Friction of the bearing is in the torque, in newton metres."""
    answer = compare(spun(drag_Nm=0.01), Propeller()).answer
    (effect,) = answer.effects
    assert (effect.name, effect.channel) == ("coulomb-friction", "torque_Nm")
    size = effect.parameters["coulomb_current"]
    assert size.unit == "N·m"
    assert size.low < 0.01 < size.high


def test_a_channel_that_holds_no_reading_is_not_compared() -> None:
    """The others are, and a note says so; without a reading of any there is nothing to compare."""
    recording = spun(drag_Nm=0.01)
    dead = np.full(recording.shape, np.nan)
    answer = compare(recording.with_channels(thrust_N=dead), checked(Propeller())).answer
    assert [(effect.name, effect.channel) for effect in answer.effects] == [("coulomb-friction", "torque_Nm")]
    assert "thrust_N holds no reading: it is not compared." in answer.notes
    assert [fit.channel for fit in answer.fits] == ["torque_Nm"]
    with pytest.raises(MismatchError, match="thrust_N"):
        compare(recording.with_channels(thrust_N=dead, torque_Nm=dead), checked(Propeller()))


def test_a_prediction_without_one_of_its_channels_is_refused() -> None:
    """The message names the class and the channel."""

    class Half(Propeller):
        def predict(self, inputs: Mapping[str, Any], values: Mapping[str, float]) -> Any:
            return {"thrust_N": super().predict(inputs, values)["thrust_N"]}

    with pytest.raises(SimulationError, match="Half must return a mapping with torque_Nm"):
        compare(spun(), Half())


class OneGain(Propeller):
    """Thrust and torque with one coefficient."""

    parameters: ClassVar = {"gain": Prior(1.2e-5, 5e-7)}

    def predict(self, inputs: Mapping[str, Any], values: Mapping[str, float]) -> Any:
        """Return both, in proportion to each other."""
        thrust = values["gain"] * inputs["speed_rad_s"] * np.abs(inputs["speed_rad_s"])
        return {"thrust_N": thrust, "torque_Nm": thrust / 69.5}


def test_a_parameter_that_another_channel_knows_does_not_explain_what_is_missing() -> None:
    """The torque is 15 % larger than predicted; alone it would move the coefficient by four standard deviations."""
    found = compare(spun(), OneGain()).answer
    (gain,) = found.parameters
    assert (gain.prior, gain.prior_std) == (1.2e-5, 5e-7)
    assert gain.value == pytest.approx(1.22e-5, rel=0.01)
    assert {each.channel for each in (*found.effects, *found.unexplained)} == {"torque_Nm"}


def posterior(value: float, std: float, prior: float = 2.0, prior_std: float = 0.5) -> CalibratedParameter:
    """Return what a channel says of a mass."""
    return CalibratedParameter("mass_kg", "kg", prior, prior_std, value, value - 1.645 * std, value + 1.645 * std)


def test_another_channel_is_asked_where_a_parameter_left_its_prior() -> None:
    """The one that knows it best, if it knows it better and explains its own readings."""
    left, inside = (replace(ANSWER, verdict="consistent", parameters=(posterior(m, 0.1),)) for m in (4.0, 2.1))
    sharp = replace(inside, parameters=(posterior(2.3, 0.05),))
    assert priors_from_others(left, [inside, sharp])["mass_kg"] == pytest.approx((2.3, 0.05), rel=1e-3)
    assert not priors_from_others(inside, [sharp])
    assert not priors_from_others(left, [replace(sharp, verdict="unexplained")])
    assert not priors_from_others(left, [replace(sharp, parameters=(posterior(2.3, 0.2),))])


def test_a_note_of_one_channel_is_told_with_the_channel() -> None:
    """And a note of all channels once, as it is."""
    current = replace(ANSWER, notes=("a gap", "no speed"), fit=replace(ANSWER.fit, channel="current_A"))
    heat = replace(ANSWER, notes=("a gap",), fit=replace(ANSWER.fit, channel="heat_W"))
    assert notes_of([current, heat]) == ("a gap", "current_A: no speed")
    assert notes_of([replace(current, notes=("current_A is blank",)), heat]) == ("current_A is blank", "heat_W: a gap")
    own = "speed is the reading of current_A itself"
    assert notes_of([replace(current, notes=(own,)), heat]) == (f"current_A: {own}", "heat_W: a gap")


class Loaded(Simulation):
    """A gain that two channels show, the second more precisely."""

    channels: ClassVar = {"coarse_V": "V", "fine_A": "A"}
    inputs = ("speed_rad_s",)
    parameters: ClassVar = {"gain": Prior(2.0, 0.05)}

    def predict(self, inputs: Mapping[str, Any], values: Mapping[str, float]) -> Any:
        """Return both channels in proportion to the speed."""
        return dict.fromkeys(self.channels, values["gain"] * inputs["speed_rad_s"])

    def covariates(self, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """Return the time."""
        return {"time": inputs["t_s"]}


def test_a_parameter_that_both_channels_show_to_be_wrong_is_told_from_its_stated_prior() -> None:
    """What one channel knows is the other's prior for its own comparison, and not the answer's."""
    generator, time_s = np.random.default_rng(6), 0.1 * np.arange(2400)
    speed = 3 + np.sin(time_s / 9)
    columns = {
        "coarse_V": 2.3 * speed + generator.normal(0, 0.5, len(time_s)),
        "fine_A": 2.3 * speed + generator.normal(0, 0.3, len(time_s)),
    }
    answer = compare(from_columns({"t_s": time_s, "speed_rad_s": speed, **columns}), Loaded()).answer
    (gain,) = answer.parameters
    assert (answer.verdict, gain.prior, gain.prior_std) == ("missing-physics", 2.0, 0.05)
    assert gain.beyond_prior()
    assert gain.value == pytest.approx(2.3, abs=0.02)


class Chained(Simulation):
    """Two channels that show two sums of two parameters; neither knows any parameter by itself."""

    channels: ClassVar = {"sum_V": "V", "first_V": "V"}
    inputs = ("speed_rad_s",)
    parameters: ClassVar = {"a": Prior(2.0, 0.05), "b": Prior(1.0, 0.05)}

    def predict(self, inputs: Mapping[str, Any], values: Mapping[str, float]) -> Any:
        """Return the sum of both, and the first one with a third of the second."""
        speed = inputs["speed_rad_s"]
        return {
            "sum_V": (values["a"] + values["b"]) * speed,
            "first_V": (values["a"] + 0.3 * values["b"]) * speed,
        }

    def covariates(self, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """Return the time."""
        return {"time": inputs["t_s"]}


def chained(b: float) -> Answer:
    """Compare what has this second parameter."""
    generator, time_s = np.random.default_rng(3), 0.1 * np.arange(2400)
    speed = 3 + np.sin(time_s / 9)
    columns = {
        "sum_V": (2.0 + b) * speed + generator.normal(0, 0.4, len(time_s)),
        "first_V": (2.0 + 0.3 * b) * speed + generator.normal(0, 0.4, len(time_s)),
    }
    return compare(from_columns({"t_s": time_s, "speed_rad_s": speed, **columns}), Chained()).answer


def test_channels_together_show_that_a_parameter_was_stated_wrongly() -> None:
    """The sum is 5 deviations too large, of which each parameter takes a half; both channels know whose it is."""
    answer = chained(1.25)
    first, second = answer.parameters
    assert (answer.verdict, answer.effects, answer.unexplained) == ("missing-physics", (), ())
    assert second.beyond_prior()
    assert not first.beyond_prior()
    assert second.low < 1.25 < second.high
    assert first.low < 2.0 < first.high
    assert answer.notes[0].startswith("b had to leave its prior")


def test_channels_together_know_what_each_knows_in_combination() -> None:
    """A parameter within its prior has an interval narrower than any channel's, and nothing is told."""
    answer = chained(1.05)
    _, second = answer.parameters
    assert answer.verdict == "consistent"
    assert second.low < 1.05 < second.high
    assert std_of_interval(second.low, second.high) < 0.02


def test_an_answer_beside_restated_parameters_is_no_surer_than_before() -> None:
    """Beside the parameter as all channels have it, an effect that acts as it does gains nothing any more."""
    fit = FitImprovement("torque_Nm", 1.0, 1.0, 1.0)
    found = Answer("consistent", (), (), (), (), fit)
    other = OtherAnswer(("load-dependent-efficiency",), unexplained=False, probability=0.49)
    before = replace(found, probability=0.49, alternatives=(other,))
    now = replace(found, probability=0.98, alternatives=())
    assert no_surer_than_before(before, now) == replace(now, probability=0.49, alternatives=(other,))
    assert no_surer_than_before(now, before) is before
    unknown = replace(before, probability=None)
    assert no_surer_than_before(unknown, now) is now
    named = replace(before, changes=(SimpleNamespace(name="drag"),))  # type: ignore[arg-type]  # of other names
    assert no_surer_than_before(named, now) is now
