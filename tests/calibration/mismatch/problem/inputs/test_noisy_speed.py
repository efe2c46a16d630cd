"""A machine that swings to and fro, of which the speed is measured with noise: what acts by its sign or its rate."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Recording, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.prior import SensorError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from regolithd.calibration.mismatch.answer import Answer

Array = NDArray[np.float64]
COUNT, STEP_S = 4000, 0.02
SPRING, DASHPOT = 40.0, 6.0
SPEED_STD = 0.01


class Damper(Simulation):
    """A spring and a dashpot on a test machine."""

    channel, unit = "force_N", "N"
    inputs = ("displacement_m", "speed_m_s")
    parameters: ClassVar = {"spring": Prior(SPRING, 1.0, "N/m"), "dashpot": Prior(DASHPOT, 0.2, "N s/m")}
    sensors: ClassVar = {"speed_m_s": SensorError(absolute=SPEED_STD)}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the force of both."""
        return values["spring"] * inputs["displacement_m"] + values["dashpot"] * inputs["speed_m_s"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_m_s"]}


def swung(missing: Callable[[Array, Array], Array], noise: float = 0.05) -> Recording:
    """Return a recording in which a force acts beside spring and dashpot, of the true speed and acceleration."""
    random, time = np.random.default_rng(33), STEP_S * np.arange(COUNT)
    rate = np.interp(time, np.linspace(0, time[-1], 12), random.uniform(1.0, 8.0, 12))
    size = np.interp(time, np.linspace(0, time[-1], 15), random.uniform(0.05, 0.3, 15))
    place = size * np.sin(np.cumsum(rate) * STEP_S)
    speed = np.gradient(place, STEP_S)
    force = SPRING * place + DASHPOT * speed + missing(speed, np.gradient(speed, STEP_S))
    columns = {
        "t_s": time,
        "displacement_m": place,
        "speed_m_s": speed + random.normal(0, SPEED_STD, COUNT),
        "force_N": force + random.normal(0, noise, COUNT),
    }
    return from_columns(columns)


def sizes(answer: Answer) -> dict[str, float]:
    """Return each effect's first parameter."""
    return {effect.name: next(iter(effect.parameters.values())).value for effect in answer.effects}


def test_friction_reverses_when_the_machine_does() -> None:
    """Dry friction beside inertia: both with their sizes, though the sign of a reading is often wrong at a reversal."""
    answer = compare(swung(lambda speed, rate: 1.0 * np.sign(speed) + 0.3 * rate), Damper()).answer
    assert sizes(answer) == pytest.approx({"coulomb-friction": 1.0, "rotor-inertia": 0.3}, rel=0.05)


def test_inertia_is_no_delay_of_the_speed() -> None:
    """A rate that is differentiated from readings is noise; a late speed would fit better, with other parameters."""
    answer = compare(swung(lambda speed, rate: 0.4 * rate + 0.4 * speed * np.abs(speed)), Damper()).answer
    assert sizes(answer) == pytest.approx({"quadratic-drag": 0.4, "rotor-inertia": 0.4}, rel=0.05)
    assert not any("prior" in note for note in answer.notes)


def test_nothing_is_found_where_nothing_is_missing() -> None:
    """Neither friction nor inertia stands for what the speed's noise does."""
    assert compare(swung(lambda _, rate: 0.0 * rate), Damper()).answer.verdict == "consistent"
