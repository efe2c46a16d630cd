"""Simulations whose parameters are stated as hardly known, where the tangents at the stated values mislead."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.calibration.starting_values import starting_values
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.build import build_problem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.data.recording import Recording

Array = NDArray[np.float64]
STEP_S, INSTANTS, NOISE = 0.02, 3000, 0.02
FRICTION_A = 1.0


class Axis(Simulation):
    """An axis that runs both ways under a load."""

    channel, unit = "motor_current_A", "A"

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rad_s"]}


class Product(Axis):
    """A load that grows: at 0 neither factor has a tangent."""

    parameters: ClassVar = {"gain_A_N": Prior(0.0, 2.0, "A/N"), "growth": Prior(0.0, 2.0)}
    truth: ClassVar = {"gain_A_N": 0.3, "growth": 1.5}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current [A]."""
        return values["gain_A_N"] * inputs["load_N"] * (1 + values["growth"] * inputs["t_s"] / 60)


class Exponential(Axis):
    """A load that doubles with the temperature."""

    parameters: ClassVar = {"current_A": Prior(0.0, 3.0, "A"), "per_K": Prior(0.0, 0.1, "1/K")}
    truth: ClassVar = {"current_A": 1.0, "per_K": 0.05}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current [A]."""
        return values["current_A"] * inputs["load_N"] / 10 * np.exp(values["per_K"] * (inputs["oil_degC"] - 20))


class Saturation(Axis):
    """A drive that saturates, whose slope is known to be positive and refused where it is not."""

    parameters: ClassVar = {"current_A": Prior(0.0, 6.0, "A"), "slope_s": Prior(0.3, 2.0, "s")}
    truth: ClassVar = {"current_A": 4.0, "slope_s": 1.2}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current [A]."""
        if values["slope_s"] < -1:
            raise SimulationError("slope_s cannot be below −1 s")
        return values["current_A"] * np.tanh(values["slope_s"] * inputs["speed_rad_s"])


def course(period_s: float, seed: int) -> Array:
    """Return four incommensurate sines of falling amplitude."""
    time_s = np.arange(INSTANTS) * STEP_S
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, 4)
    return sum(
        (np.sin(2 * np.pi * time_s / period_s * k**1.3 + phase) / k for k, phase in enumerate(phases, 1)),
        np.zeros(INSTANTS),
    )


def recording_of(axis: Any, friction_A: float = 0.0) -> Recording:  # any of the three
    """Return a recording at the true values, with Coulomb friction that the simulation lacks."""
    time_s = np.arange(INSTANTS) * STEP_S
    columns = {
        "t_s": time_s,
        "speed_rad_s": 2 + 1.2 * course(13, 1),
        "load_N": 30 + 8 * course(29, 2),
        "oil_degC": 20 + 15 * course(60, 5),
    }
    current = axis.predict(columns, axis.truth)
    noise = np.convolve(np.random.default_rng(3).normal(0, 1.3, INSTANTS), [0.3, 0.7], "same")
    reading = current + friction_A * np.sign(columns["speed_rad_s"]) + NOISE * np.abs(current).mean() * noise
    return from_columns({**columns, "motor_current_A": reading})


def answer_to(axis: Axis, friction_A: float = 0.0) -> Answer:
    """Compare the simulation with the recording."""
    return compare(recording_of(axis, friction_A), axis).answer


MACHINES = [Product, Exponential, Saturation]


@pytest.mark.parametrize("machine", MACHINES)
def test_nothing_is_missing_where_the_values_are_found(machine: Any) -> None:
    """Each value is found to a few percent, and nothing is made of the way there."""
    found = answer_to(machine())
    assert (found.verdict, found.effects, found.unexplained) == ("consistent", (), ())
    told = {parameter.name: parameter.value for parameter in found.parameters}
    assert told == pytest.approx(machine.truth, rel=0.04)


def test_other_values_that_fit_as_well_are_told() -> None:
    """Both signs of a wave's amplitude are possible, each with its phase."""

    class Wave(Axis):
        parameters: ClassVar = {"current_A": Prior(0.0, 3.0, "A"), "phase": Prior(0.0, 2.0)}
        truth: ClassVar = {"current_A": 2.0, "phase": 1.9}

        def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
            return values["current_A"] * np.cos(np.cumsum(inputs["speed_rad_s"], axis=0) * STEP_S + values["phase"])

    found = answer_to(Wave())
    assert found.verdict == "consistent"
    told = {parameter.name: parameter.value for parameter in found.parameters}
    assert told == pytest.approx({"current_A": -2.0, "phase": 1.9 - np.pi}, rel=0.02)
    assert [note for note in found.notes if "Other values" in note and "current_A 2" in note and "phase 1.9" in note]


@pytest.mark.parametrize("machine", MACHINES)
def test_friction_is_found_beside_values_that_are_hardly_known(machine: Any) -> None:
    """And nothing else."""
    found = answer_to(machine(), FRICTION_A)
    assert [effect.name for effect in found.effects] == ["coulomb-friction"]
    assert found.unexplained == ()
    assert found.effects[0].parameters["coulomb_current"].value == pytest.approx(FRICTION_A, rel=0.1)


def test_stated_values_are_a_start_where_the_tangents_hold_or_the_values_are_known() -> None:
    """The search costs runs of the simulation, so it is left out where it changes nothing."""

    class Linear(Axis):
        runs = 0
        parameters: ClassVar = {"offset_A": Prior(0.0, 5.0, "A"), "gain_A_N": Prior(0.0, 1.0, "A/N")}
        truth: ClassVar = {"offset_A": 1.2, "gain_A_N": 0.11}

        def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
            type(self).runs += 1
            return values["offset_A"] + values["gain_A_N"] * inputs["load_N"]

    class Known(Exponential):
        parameters: ClassVar = {"current_A": Prior(1.1, 0.2, "A"), "per_K": Prior(0.05, 0.01, "1/K")}

    for machine in (Linear(), Known()):
        problem = build_problem(recording_of(machine), machine)
        Linear.runs = 0
        assert starting_values(problem).values is None
    assert Linear.runs < 10
