"""The direction of motion: the sign of a speed, and none where the axis stands."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch import Prior, SensorError, Simulation
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.covariates import direction_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

COUNT = 3000


def moves() -> NDArray[np.float64]:
    """Return the speed of an axis that runs forwards, stands, runs backwards and stands again, shape (time, 1)."""
    return np.resize(np.repeat([10.0, 0.0, -10.0, 0.0], 150), COUNT)[:, None]


def test_noise_at_standstill_is_no_direction() -> None:
    """The sign of a reading about zero is that of the sensor's noise; of a moving axis it is the direction."""
    true = moves()
    read = true + np.random.default_rng(1).normal(0, 0.1, true.shape)
    found = direction_of(read)
    assert np.mean(found[true == 0] != 0) < 0.01
    np.testing.assert_array_equal(found[true != 0], np.sign(true[true != 0]))


def test_a_speed_without_noise_has_its_sign() -> None:
    """Also where it passes zero slowly; what is not known has none."""
    speed = np.sin(np.arange(COUNT) / 300)[:, None]
    speed[:20] = np.nan
    found = direction_of(speed)
    assert np.isnan(found[:20]).all()
    assert np.mean(found[20:] != np.sign(speed[20:])) < 0.001


def test_of_a_fast_oscillation_hardly_a_reading_is_lost() -> None:
    """Its readings change as much as noise would, but not where it passes zero."""
    speed = np.sin(np.arange(COUNT) * 2 * np.pi / 16)[:, None]
    assert np.mean(direction_of(speed) == 0) < 0.15


class Belt(Simulation):
    """A belt whose speed is read with an error."""

    channel, unit = "current_A", "A"
    inputs = ("speed_m_s",)
    parameters: ClassVar = {"load": Prior(1.0, 0.1, "A")}
    sensors: ClassVar = {"speed_m_s": SensorError(absolute=0.1)}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the load, against the motion."""
        return values["load"] * np.sign(inputs["speed_m_s"])

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_m_s"]}


def test_a_speed_that_is_smoothed_stands_where_it_was_read_as_zero() -> None:
    """Smoothing must not move a standing axis: neither its direction nor what the simulation predicts of it."""
    speed = moves()[:, 0]
    random = np.random.default_rng(2)
    read = np.where(speed == 0, 0.0, speed + random.normal(0, 0.1, COUNT))
    current = np.sign(speed) + random.normal(0, 0.1, COUNT)
    problem = build_problem(
        from_columns({"t_s": 0.1 * np.arange(COUNT), "speed_m_s": read, "current_A": current}), Belt()
    )
    standing = speed == 0
    assert not problem.covariates["direction"][standing].any()
    assert not problem.prediction[standing].any()
    assert np.any(problem.recording.channels["speed_m_s"][~standing, 0] != read[~standing])
