"""A parameter far beyond its prior is a finding, and no curve takes its place."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import CANDIDATES, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch import Candidate, Coefficient, Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.selection.plausibility import released_parameters

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch import Problem, Shape
    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

ROWS = 3000


class Heated(Simulation):
    """A body that loses heat in proportion to its temperature: stateful, nonlinear in the loss."""

    channel, unit = "body_temperature_degC", "degC"
    inputs = ("power_W",)
    parameters: ClassVar = {"loss_W_K": Prior(4.0, 0.1, "W/K"), "capacity_J_K": Prior(2000.0, 40.0, "J/K")}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the temperature over that of the room, by explicit steps of a second."""
        found, now = np.zeros_like(inputs["power_W"]), 0.0
        for row, power in enumerate(inputs["power_W"][:, 0]):
            found[row] = now
            now += (power - values["loss_W_K"] * now) / values["capacity_J_K"]
        return found


def answer(loss_W_K: float, leak_W: float = 0.0, noise_K: float = 12.0, machine: Simulation | None = None) -> Answer:
    """Compare with a body whose loss is this, from half of the time on with a further constant loss."""
    generator = np.random.default_rng(4)
    time_s = np.arange(ROWS, dtype=float)
    power = np.where((time_s // 400) % 2 == 0, 300.0, 80.0)
    true = Heated().predict(
        {"power_W": (power - leak_W * (time_s > 1500))[:, None]}, {"loss_W_K": loss_W_K, "capacity_J_K": 2000.0}
    )[:, 0]
    noise = np.convolve(generator.normal(0, 1, ROWS + 11), np.ones(12) / np.sqrt(12), "valid")
    return compare(
        from_columns({"t_s": time_s, "power_W": power, "body_temperature_degC": true + noise_K * noise}),
        machine or Heated(),
    ).answer


def test_a_parameter_six_deviations_off_is_told_with_its_value_and_nothing_else() -> None:
    """The finding is the parameter; there is no name, and nothing unexplained."""
    found = answer(3.4)
    loss = next(parameter for parameter in found.parameters if parameter.name == "loss_W_K")
    assert (found.verdict, found.effects, found.unexplained) == ("missing-physics", (), ())
    assert loss.value == pytest.approx(3.4, abs=0.1)
    assert loss.low < 3.4 < loss.high


class FirmlyStated(Heated):
    """The same body, whose loss is said to be known to 1 %."""

    parameters: ClassVar = {**Heated.parameters, "loss_W_K": Prior(4.0, 0.04, "W/K")}


def test_half_of_its_value_is_no_limit_however_firmly_it_was_stated() -> None:
    """It is 15 standard deviations away, further than a parameter goes that is known less well."""
    found = answer(3.4, machine=FirmlyStated())
    (loss,) = (each for each in found.parameters if each.name == "loss_W_K")
    assert (found.verdict, found.effects, found.unexplained) == ("missing-physics", (), ())
    assert loss.low < 3.4 < loss.high
    assert Prior(4.0, 0.04).furthest(8.0) == pytest.approx(50.0)
    assert Prior(4.0, 0.4).furthest(8.0) == 8.0
    assert Prior(4.0).furthest(8.0) == 8.0
    assert Prior(4.0, 0.04).reach(8.0) == pytest.approx(20.0)


def test_what_no_parameter_explains_stays_unexplained() -> None:
    """A loss that begins half way is located in time, though parameters would absorb a part of it."""
    found = answer(4.0, leak_W=100.0)
    assert found.verdict == "unexplained"
    assert [term.covariate for term in found.unexplained] == ["time"]


def test_a_wrong_statement_has_a_price(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it is dearer than names and curves within the priors, the parameter is not freed."""
    monkeypatch.setattr(released_parameters, "WRONG_STATEMENT_PENALTY", 1e6)
    loss = next(parameter for parameter in answer(3.4).parameters if parameter.name == "loss_W_K")
    assert loss.value > 3.41


def test_a_prior_as_firm_as_the_readings_does_not_hide_that_it_is_wrong() -> None:
    """It would hold the parameter half way back, within three of its deviations."""
    found = answer(3.55)
    loss = next(parameter for parameter in found.parameters if parameter.name == "loss_W_K")
    assert (found.verdict, found.effects, found.unexplained) == ("missing-physics", (), ())
    assert loss.beyond_prior()
    assert loss.low < 3.55 < loss.high


def test_readings_that_say_little_contradict_no_prior() -> None:
    """Noise moves a parameter that the readings hardly know, and its prior holds it."""
    found = answer(3.9, noise_K=60.0)
    assert (found.verdict, found.effects) == ("consistent", ())
    assert not any(parameter.beyond_prior() for parameter in found.parameters)


def test_of_parameters_that_are_like_each_other_one_is_released() -> None:
    """The loss alone explains what is wrong: the capacity stays within its prior."""
    found = {parameter.name: parameter for parameter in answer(3.4).parameters}
    assert found["loss_W_K"].beyond_prior()
    assert not found["capacity_J_K"].beyond_prior()


class Braked(Simulation):
    """A wheel with a bearing and a brake, which act alike as far as the brake is pulled as the wheel turns."""

    channel, unit = "motor_current_mA", "mA"
    inputs = ("speed_rad_s", "pulled")
    parameters: ClassVar = {"bearing_mA_s": Prior(8.0, 0.4, "mA s"), "brake_mA_s": Prior(10.0, 0.4, "mA s")}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the current [mA]."""
        return (values["bearing_mA_s"] + values["brake_mA_s"] * inputs["pulled"]) * inputs["speed_rad_s"]


def braked(brake_mA_s: float) -> Answer:
    """Compare with a wheel whose brake is this strong; the noise is a tenth of the mean reading."""
    generator, time_s = np.random.default_rng(6), np.arange(ROWS) / 10
    speed = 3 + np.sin(time_s / 7)
    pulled = 0.5 + 0.15 * np.sin(time_s / 11) + 0.1 * np.sin(time_s / 23)
    reading = (8.0 + brake_mA_s * pulled) * speed + generator.normal(0, 4.0, ROWS)
    columns = {"t_s": time_s, "speed_rad_s": speed, "pulled": pulled, "motor_current_mA": reading}
    return compare(from_columns(columns), Braked()).answer


def test_what_was_stated_wrongly_is_the_parameter_whose_release_explains_most() -> None:
    """Held by its prior the brake leaves a part of the way to the bearing, which is then further from its own."""
    found = braked(14.2)
    bearing, brake = found.parameters
    assert (found.verdict, found.effects, found.unexplained) == ("missing-physics", (), ())
    assert not bearing.beyond_prior()
    assert brake.low < 14.2 < brake.high


def test_no_other_parameter_is_told_in_the_place_of_one_that_goes_too_far() -> None:
    """No brake is two and a half times as strong as it was stated: what is left has no name."""
    found = braked(25.0)
    assert (found.verdict, found.effects) == ("unexplained", ())


class Waving(Candidate):
    """An offset with a wave of a fifth of its size: without the wave it acts as the parameter `level` does."""

    name, covariate, equation, words, signature = "waving", "none", "ΔV = c (1 + s/5)", "a level", "a level"
    experiment, source = "wait", "test"
    coefficients: ClassVar = (Coefficient("height", "{unit}", 0),)

    def columns(self, problem: Problem, shape: Shape) -> NDArray[np.float64]:  # noqa: ARG002
        """Return 1 with the wave."""
        return np.broadcast_to(1 + 0.2 * np.sin(problem.time_s / 3), problem.mask.shape)[None]


def released_beside_a_wave(
    wave: float,
) -> tuple[Fit, tuple[NormalEquations, Fit] | None, tuple[released_parameters.OtherStatement, ...]]:
    """Return the fit of the name for a level with this wave, what is released in its place, and the other answers."""
    columns = table(noise=2.0)
    columns["reading_V"] = columns["reading_V"] + 3.0 * (1 + wave * np.sin(columns["t_s"] / 3))
    equations = equations_of(problem_of(columns), (*CANDIDATES, Waving()))
    equations = equations.weighted(np.full(2, 2.0**-2))
    named = equations.fit([term_of(equations, "waving")])
    return named, *released_parameters.released(equations, named, named, 5.0)


@pytest.mark.parametrize(("wave", "is_named"), [(0.0, False), (0.2, True)])
def test_a_name_that_a_wrong_statement_explains_as_well_is_given_up(wave: float, is_named: bool) -> None:
    """A level that is 6 deviations off is no effect; what has the effect's own wave is one."""
    named, found, others = released_beside_a_wave(wave)
    assert (found is None) == is_named
    if found:
        freed, fit = found
        assert fit.terms == ()
        assert fit.coefficients[0] / freed.design.scale[0] == pytest.approx(3.0, abs=0.3)
        (within,) = (each for each in others if not each.parameters)
        assert (within.instead_of, within.terms) == ((), named.terms)
        assert within.margin > 4


@pytest.mark.parametrize("wave", [0.2, 0.082])
def test_a_name_is_as_probable_as_how_far_a_wrong_statement_is_behind(wave: float) -> None:
    """Of a small wave little is left beside a level that is off; the name that passed is no less probable than that."""
    _, found, others = released_beside_a_wave(wave)
    margins = {each.parameters: each.margin for each in others if not each.terms}
    assert found is None
    assert margins == ({("level",): 0.0} if wave < 0.1 else {})


class RubbingDrive(Simulation):
    """A drive whose friction is a parameter: the law of Coulomb friction is in the simulation."""

    channel, unit = "motor_current_A", "A"
    inputs = ("speed_rad_s", "load_Nm")
    parameters: ClassVar = {"friction_A": Prior(1.0, 0.05, "A"), "gain_A_Nm": Prior(0.5, 0.02, "A/Nm")}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the current."""
        return values["friction_A"] * np.sign(inputs["speed_rad_s"]) + values["gain_A_Nm"] * inputs["load_Nm"]

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rad_s"]}


def rubbing(friction_A: float, seed: int) -> Answer:
    """Compare with a drive that has this friction."""
    generator = np.random.default_rng(seed)
    speed = np.repeat(generator.uniform(1, 9, 60) * generator.choice([-1.0, 1.0], 60), 50)
    load = np.repeat(generator.uniform(0, 8, 100), 30)
    current = friction_A * np.sign(speed) + 0.5 * load + generator.normal(0, 0.8, ROWS)
    columns = {"t_s": 0.1 * np.arange(ROWS), "speed_rad_s": speed, "load_Nm": load, "motor_current_A": current}
    return compare(from_columns(columns), RubbingDrive()).answer


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_wrong_parameter_has_no_effects_name_whose_law_it_has(seed: int) -> None:
    """Five standard deviations are a wrong statement; twelve are more than one explains, and the effect is named."""
    found = rubbing(1.25, seed)
    (friction,) = (each for each in found.parameters if each.name == "friction_A")
    assert (found.verdict, found.effects, found.unexplained) == ("missing-physics", (), ())
    assert friction.beyond_prior()
    assert friction.low < 1.25 < friction.high
    assert [effect.name for effect in rubbing(2.5, seed).effects] == ["coulomb-friction"]


class Cart(Simulation):
    """A motor's current: rolling resistance of a mass, and the motor's own friction."""

    channel, unit = "motor_A", "A"
    inputs = ("wheel_rad_s", "mass_kg")
    parameters: ClassVar = {"rolling_A_kg": Prior(0.02, 0.001, "A/kg"), "idle_A": Prior(1.2, 0.06, "A")}
    parameter_effects: ClassVar = {"idle_A": "coulomb-friction"}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return both against the motion."""
        size = values["rolling_A_kg"] * inputs["mass_kg"] + values["idle_A"]
        return np.asarray(size * np.sign(inputs["wheel_rad_s"]))

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return the speed and the mass."""
        return {"wheel_speed": inputs["wheel_rad_s"], "mass": inputs["mass_kg"]}


def cart(mass_kg: NDArray[np.float64]) -> Answer:
    """Return the answer to a cart with a Coulomb friction of 1 A that the simulation does not have."""
    rng, rows = np.random.default_rng(8), len(mass_kg)
    speed = 3 * np.sign(np.sin(np.arange(rows) / 25)) * (1 + 0.5 * np.sin(np.arange(rows) / 180))
    current = (0.02 * mass_kg + 2.2) * np.sign(speed) + rng.normal(0, 1.0, rows)
    return compare(
        {"t_s": 0.1 * np.arange(rows), "motor_A": current, "wheel_rad_s": speed, "mass_kg": mass_kg}, Cart()
    ).answer


def test_an_effect_is_no_parameter_of_its_law_where_another_parameter_leaves_its_prior_without_it() -> None:
    """Of one mass, more rolling resistance acts as the friction does: both are told, neither as sure."""
    answer = cart(np.full(ROWS, 185.0))
    assert answer.probability is not None
    assert answer.probability < 0.7
    next_best, *others = answer.alternatives
    assert {tuple(effect.name for effect in answer.effects), next_best.effects} == {(), ("coulomb-friction",)}
    assert sum(other.probability for other in others) < 0.02


def test_a_mass_that_varies_tells_the_effect_from_the_parameter() -> None:
    """It is the friction alone."""
    answer = cart(np.repeat([100.0, 300.0, 200.0], ROWS // 3))
    assert [effect.name for effect in answer.effects] == ["coulomb-friction"]
