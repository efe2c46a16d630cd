"""Noise that grows with what is measured: readings are weighed by it, and it is no physics."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.inputs.input_doubt import InputDoubt
from regolithd.calibration.mismatch.regression.equations import smooth_equations
from regolithd.calibration.mismatch.regression.likelihood.reliability import (
    LEAST_RELIABILITY,
    noise_size_of,
    reliability_of,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.problem.problem import Problem

Array = NDArray[np.float64]
COUNT, LEAST_N, SHARE = 3000, 3.0, 0.05


class Thruster(Simulation):
    """Thrust by the square of the speed, ahead and astern."""

    channel, unit = "thrust_N", "N"
    inputs = ("speed_rad_s",)
    parameters: ClassVar = {"ahead": Prior(0.010, 0.0003, "N s²"), "astern": Prior(0.007, 0.0003, "N s²")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the thrust."""
        speed = inputs["speed_rad_s"]
        return np.where(speed > 0, values["ahead"], values["astern"]) * speed * np.abs(speed)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed, and a temperature that has nothing to do with it."""
        return {"wheel_speed": inputs["speed_rad_s"], "temperature": inputs["water_degC"]}


def operated(seed: int, share: float = SHARE, lost: float = 0.0) -> Recording:
    """Return an operation at several speeds; the noise is `share` of the thrust, and what is `lost` grows too."""
    random, t_s = np.random.default_rng(seed), 0.2 * np.arange(COUNT)
    speed = np.repeat(random.uniform(-70, 140, COUNT // 100), 100)
    thrust = np.where(speed > 0, 0.0101, 0.0069) * speed * np.abs(speed)
    noise = random.normal(size=COUNT) * (LEAST_N + share * np.abs(thrust))
    water = 12 + 4 * np.sin(t_s / 160 + random.uniform(0, 6))
    measured = thrust + lost * speed + noise
    return from_columns({"t_s": t_s, "speed_rad_s": speed, "water_degC": water, "thrust_N": measured})


def sized(recording: Recording) -> tuple[Problem, Array | None]:
    """Return the problem, and by how much its noise grows."""
    equations = smooth_equations(problem := build_problem(recording, Thruster()))
    return problem, noise_size_of(equations, equations.fit(()))


def test_the_growth_is_that_of_the_noise() -> None:
    """Where the thrust is largest, several times the noise at rest; to a seventh, since its form is one of many."""
    problem, found = sized(operated(1))
    assert found is not None
    size = np.abs(problem.filled[:, 0])
    largest = size > np.quantile(size, 0.9)
    true = np.mean(LEAST_N + SHARE * size[largest]) / LEAST_N
    least = np.median(found[size < np.quantile(size, 0.1)])
    assert np.mean(found[largest]) / least == pytest.approx(true, rel=0.15)


def test_noise_that_is_alike_everywhere_is_left_so() -> None:
    """Neither chance nor jumps of a law that is left out count as growth, and readings then weigh alike."""
    for seed in range(10):
        problem, found = sized(operated(seed, share=0.0, lost=0.3))
        assert found is None
        assert reliability_of(smooth_equations(problem).design, problem.residual) is None


@pytest.mark.parametrize("seed", range(3))
def test_noise_that_grows_is_no_physics(seed: int) -> None:
    """Nothing is found where nothing is left out; a drag is, beside the same noise."""
    assert compare(operated(seed), Thruster()).answer.verdict == "consistent"
    found = compare(operated(seed, lost=0.06), Thruster()).answer
    assert [effect.name for effect in found.effects] == ["viscous-friction"]
    size = found.effects[0].parameters["relative_size"]
    assert size.low > 0


def test_one_reading_in_great_doubt_is_no_evidence() -> None:
    """Beside a step of the prediction an input's error is all of it; what all such readings lose is passed over."""
    problem = build_problem(operated(1, share=0.0), Thruster())
    residual, doubt = problem.residual.copy(), np.zeros(problem.mask.shape)
    residual[700], doubt[700] = 25 * LEAST_N, (20 * LEAST_N) ** 2
    none = np.zeros(doubt.shape)
    doubtful = replace(problem, doubt=InputDoubt(doubt, doubt, none, np.zeros((0, *doubt.shape))))
    factors = reliability_of(smooth_equations(doubtful).design, residual)
    assert factors is not None
    least, *others = np.sort(factors.in_means.ravel())
    assert least < LEAST_RELIABILITY < others[0]
