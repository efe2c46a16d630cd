"""Something periodic in time that acts whatever the motion is, on a carriage that moves to and fro."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from scipy.signal import lfilter

from regolithd.calibration.mismatch import Prior, Simulation, compare, from_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer

INSTANTS, STEP_S, PERIOD_S = 3000, 0.2, 12.0


class Carriage(Simulation):
    """A hull that is towed to and fro: its drag grows with the square of its speed, against the motion."""

    channel, unit = "drag_N", "N"
    inputs = ("speed_m_s", "place_m")
    parameters: ClassVar = {"form_N_s2_m2": Prior(8.0, 0.4, "N s²/m²")}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the drag."""
        speed = inputs["speed_m_s"]
        return values["form_N_s2_m2"] * speed * np.abs(speed)

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return speed and place."""
        return {"wheel_speed": inputs["speed_m_s"], "place": inputs["place_m"]}


def answer(disturbance_N: NDArray[np.float64]) -> Answer:
    """Compare a drive, on which this acts as well, with the simulation."""
    rng = np.random.default_rng(2)
    speed = 1.6 * np.sin(TIME_S / 19) * (1 + 0.3 * np.sin(TIME_S / 53))
    place = 40 + np.cumsum(speed) * STEP_S
    drag = 8.1 * speed * np.abs(speed) + disturbance_N + rng.normal(0, 1.0, INSTANTS)
    return compare(
        from_columns({"t_s": TIME_S, "speed_m_s": speed, "place_m": place, "drag_N": drag}), Carriage()
    ).answer


TIME_S = STEP_S * np.arange(INSTANTS)
WAVE = np.sin(2 * np.pi * TIME_S / PERIOD_S + 0.4)


def test_a_wave_is_unexplained_over_time_with_its_period() -> None:
    """It is no drag, since it pushes whichever way the carriage moves, and no covariate follows it as well."""
    found = answer(1.5 * WAVE)
    assert found.verdict == "unexplained"
    (place,) = found.unexplained
    assert (place.covariate, found.effects) == ("time", ())
    assert place.period == pytest.approx(PERIOD_S, rel=0.01)
    assert not any("nearly as well" in note for note in found.notes)


def test_a_disturbance_that_acts_along_the_motion_is_too() -> None:
    """A drag that swells and fades with the same period changes its sign with the motion."""
    speed = np.sin(TIME_S / 19) * (1 + 0.3 * np.sin(TIME_S / 53))
    (place,) = answer(1.5 * WAVE * np.sign(speed)).unexplained
    assert place.covariate == "time"
    assert place.period == pytest.approx(PERIOD_S, rel=0.01)


def test_a_slow_wave_is_not_taken_for_the_noise() -> None:
    """With a period of 31 s, in noise of which a third lasts for 2 s: it is as large as the noise."""
    rng = np.random.default_rng(5)
    lasting = lfilter([1.0], [1.0, -np.exp(-STEP_S / 2)], rng.normal(0, 1, INSTANTS))
    wave = 1.7 * np.sin(2 * np.pi * TIME_S / 31.0)
    (place,) = answer(wave + 0.7 * lasting / np.std(lasting)).unexplained
    assert place.covariate == "time"
    assert place.period == pytest.approx(31.0, rel=0.02)


def test_a_still_day_is_consistent() -> None:
    """Without a wave nothing is unexplained."""
    assert answer(np.zeros(INSTANTS)).verdict == "consistent"
