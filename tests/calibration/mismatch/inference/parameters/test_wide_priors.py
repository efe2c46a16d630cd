"""A joint of which somebody knows the equations alone: wide priors about 0, and hardly any noise."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.answer import Answer

Array = NDArray[np.float64]
STEP_S, INSTANTS = 0.02, 3000
INERTIA, WEIGHT_A = 1.7, 10.5


class Joint(Simulation):
    """The current of inertia and weight, without friction."""

    channel, unit = "motor_current_A", "A"
    inputs = ("acceleration_rad_s2", "angle_rad")
    parameters: ClassVar = {"inertia_A_s2": Prior(0.5, 2.0, "A s²"), "weight_A": Prior(0.0, 6.0, "A")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current [A]."""
        inertia = values["inertia_A_s2"] * inputs["acceleration_rad_s2"]
        return inertia + values["weight_A"] * np.cos(inputs["angle_rad"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and angle."""
        return {"wheel_speed": inputs["speed_rad_s"], "angle": inputs["angle_rad"]}


def answer_to(friction_A: float, viscous_A_s: float, lost: float) -> Answer:
    """Compare with a joint that swings about an angle at three speeds, whose noise is 2 % of the mean reading."""
    time_s = np.arange(INSTANTS) * STEP_S
    swing = 2 * np.pi * np.cumsum(0.12 + 0.06 * np.sin(time_s / 9)) * STEP_S
    angle = 0.4 + 1.1 * np.sin(swing)
    speed = np.gradient(angle, STEP_S)
    acceleration = np.gradient(speed, STEP_S)
    carried = INERTIA * acceleration + WEIGHT_A * np.cos(angle)
    drag = friction_A + viscous_A_s * np.abs(speed) + lost * np.abs(carried)
    white = np.random.default_rng(8).normal(0, 0.2, INSTANTS)
    noise = np.convolve(white, [0.3, 0.7], "same")
    columns = {"angle_rad": angle, "speed_rad_s": speed, "acceleration_rad_s2": acceleration}
    reading = carried + drag * np.tanh(speed / 0.01) + noise
    return compare(from_columns({"t_s": time_s, **columns, "motor_current_A": reading}), Joint()).answer


def test_friction_is_no_curve_over_the_time_that_fits_it_a_little_better() -> None:
    """A curve with many knots follows any law closer than a law that is a little wrong does."""
    found = answer_to(1.0, 1.2, 0.0)
    assert {effect.name for effect in found.effects} == {"coulomb-friction", "viscous-friction"}
    assert found.unexplained == ()


def test_a_loss_is_a_share_of_what_the_joint_carries_as_it_was_calibrated() -> None:
    """At the stated values it carries nothing."""
    found = answer_to(1.0, 0.0, 0.09)
    effects = {effect.name: effect.parameters for effect in found.effects}
    assert effects.keys() == {"coulomb-friction", "load-dependent-efficiency"}
    assert effects["load-dependent-efficiency"]["relative_loss"].value == pytest.approx(0.09, rel=0.3)


def test_without_friction_nothing_is_missing() -> None:
    """However far the parameters are from 0."""
    found = answer_to(0.0, 0.0, 0.0)
    assert (found.verdict, found.effects, found.unexplained) == ("consistent", (), ())
