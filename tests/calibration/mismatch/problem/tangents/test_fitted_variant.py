"""Physics that a simulation has as a variant: its size is that of the variant, whatever step its author chose."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import (
    Candidate,
    Coefficient,
    Prior,
    Problem,
    Simulation,
    SimulationError,
    compare,
    from_columns,
)
from regolithd.calibration.mismatch.candidates.late_columns import columns_of
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.tangents.fitted_variant import VARIANT_VALUE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

Array = np.ndarray
LOSS = 0.6
"""Loss to the wind, beside a loss of 1 to the surroundings."""


class Block(Simulation):
    """A heated block that is always at its steady state: power over the sum of its losses, above the surroundings."""

    channel, unit = "excess_K", "K"
    inputs = ("power_W", "wind_m_s")
    parameters: ClassVar = {"loss": Prior(1.0, 0.02, "W/K")}

    def variants(self) -> Mapping[str, float]:
        """Return a loss to the wind, and physics that is added, switched, and not possible."""
        return {"wind_loss": 0.0, "added": 0.0, "switched": 0.0, "limited": 0.0}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the block's temperature above the surroundings."""
        if values["limited"] > 1.0:
            raise SimulationError("limited: is a share")
        power = inputs["power_W"] - 3.0 * (values["switched"] > 0)
        found = (
            power / (values["loss"] + values["wind_loss"] * inputs["wind_m_s"]) + values["added"] * inputs["wind_m_s"]
        )
        return np.asarray(found - 2 * values["limited"] ** 2 * inputs["wind_m_s"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return power and wind."""
        return {"power": inputs["power_W"], "wind": inputs["wind_m_s"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:  # noqa: ARG002
        """Return the loss to the wind alone."""
        return (WindLoss(),)


class ByVariant(Candidate):
    """The change by a variant, over its step."""

    name, variant, step, sign = "by-variant", "added", 2.0, 1.0
    covariate, along_motion = "wind", False
    equation = words = signature = experiment = source = "as the simulation has it"
    coefficients: ClassVar = (Coefficient("size", "1", 0),)

    def columns(self, problem: Problem, shape: object) -> Array:  # noqa: ARG002
        """Return the change per unit."""
        return np.asarray(self.sign * problem.secant(self.variant, self.step))[None]


class WindLoss(ByVariant):
    """A loss in proportion to the wind; the step is four times the loss."""

    name, variant, step = "wind-loss", "wind_loss", 4 * LOSS


class Counted(WindLoss):
    """The same with the other sign."""

    name, sign, step = "counted", -1.0, 0.3


class Switched(ByVariant):
    """Is there or not."""

    name, variant, step = "switched", "switched", 1.0


class Limited(ByVariant):
    """Is a share."""

    name, variant, step = "limited", "limited", 0.5


class Scaled(WindLoss):
    """Is no change by the variant alone."""

    name = "scaled"

    def columns(self, problem: Problem, shape: object) -> Array:
        """Return the change times the wind."""
        return super().columns(problem, shape) * problem.covariates["wind"]


def recorded(noise: float = 0.0, seed: int = 1) -> dict[str, Array]:
    """Return a recording of a block that loses heat to the wind."""
    rng = np.random.default_rng(seed)
    time = np.arange(900) * 1.0
    power = 20 + 8 * np.sign(np.sin(time / 37)) + 3 * np.sin(time / 91)
    wind = 2 + 1.8 * np.sin(time / 53)
    excess = power / (1.0 + LOSS * wind) + noise * rng.normal(size=len(time))
    return {"t_s": time, "power_W": power, "wind_m_s": wind, "excess_K": excess}


@pytest.fixture(scope="module")
def problem() -> Problem:
    """The problem of a recording without noise."""
    return build_problem(from_columns(recorded()), Block())


@pytest.mark.parametrize("candidate", [WindLoss(), Counted()])
def test_a_variant_is_differenced_over_the_value_that_was_fitted(problem: Problem, candidate: ByVariant) -> None:
    """Times its value the column is then what the variant changes."""
    size = candidate.sign * LOSS
    columns_of(problem, candidate, {})
    shape = candidate.self_consistent_shape(problem, {}, [size])
    assert shape == {VARIANT_VALUE: LOSS}
    (column,) = columns_of(problem, candidate, shape)
    np.testing.assert_allclose(size * column, problem.changed(wind_loss=LOSS) - problem.filled)
    assert candidate.self_consistent_shape(problem, shape, [1.01 * size]) == shape


@pytest.mark.parametrize(
    ("candidate", "value"),
    [
        pytest.param(ByVariant(), 0.7, id="acts in proportion"),
        pytest.param(Switched(), 0.7, id="is there or not"),
        pytest.param(Limited(), 1.2, id="has no such value"),
        pytest.param(Scaled(), 0.7, id="is more than the variant"),
        pytest.param(WindLoss(), 1e-6, id="far below the step"),
    ],
)
def test_another_shape_stays(problem: Problem, candidate: ByVariant, value: float) -> None:
    """Where the change over the fitted value would be the same, cannot be predicted, or is not the effect."""
    columns_of(problem, candidate, {})
    assert candidate.self_consistent_shape(problem, {}, [value]) == {}


def test_the_size_of_a_loss_does_not_depend_on_the_step_of_its_author() -> None:
    """Four times too large a step told half of the loss."""
    answer = compare(from_columns(recorded(noise=0.1)), Block()).answer
    (effect,) = answer.effects
    found = effect.parameters["size"]
    assert effect.name == "wind-loss"
    assert found.low < LOSS < found.high
    assert found.value == pytest.approx(LOSS, rel=0.05)
    assert effect.shape[VARIANT_VALUE] == pytest.approx(found.value, rel=0.05)
    assert answer.verdict == "missing-physics"
