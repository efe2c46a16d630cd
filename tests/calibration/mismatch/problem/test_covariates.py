"""The direction of motion: the sign of a speed, and none where the axis stands."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, SensorError, Simulation, compare
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


@pytest.mark.parametrize("noise", [0.1, 0.25, 0.4])
def test_noise_of_a_few_percent_of_the_usual_speed_is_no_direction(noise: float) -> None:
    """Its three standard deviations reach beyond a twentieth of that speed."""
    true = moves()
    found = direction_of(true + np.random.default_rng(1).normal(0, noise, true.shape))
    assert np.mean(found[true == 0] != 0) < 0.01
    np.testing.assert_array_equal(found[true != 0], np.sign(true[true != 0]))


def test_noise_shows_beside_a_standstill_that_is_set_to_zero() -> None:
    """While a brake holds the speed is exactly 0; before it does, the sensor's noise alternates."""
    true = moves()
    read = true + np.random.default_rng(1).normal(0, 0.1, true.shape)
    held = (true == 0) & (np.arange(COUNT)[:, None] % 150 > 15)
    found = direction_of(np.where(held, 0.0, read))
    assert np.mean(found[true == 0] != 0) < 0.01
    np.testing.assert_array_equal(found[true != 0], np.sign(true[true != 0]))


def test_where_an_axis_reads_zero_while_it_stands_the_ends_of_its_motions_have_a_sign() -> None:
    """They bend, which is no noise: a dead time at a stop would be evidence against friction."""
    phase = np.arange(COUNT) / 150
    turning = np.where(phase % 2 < 1, 2 * np.sin(np.pi * (phase % 1)) ** 4, 0.0) * np.where(phase % 4 < 2, 1, -1)
    speed = np.where(np.abs(turning) < 1e-12, 0.0, turning)[:, None]
    np.testing.assert_array_equal(direction_of(speed), np.sign(speed))


def test_single_counts_between_zeros_are_no_direction() -> None:
    """An encoder at rest on the edge of a count reads it once in a while."""
    read = moves()
    at_rest = np.flatnonzero(read[:, 0] == 0)
    counts = at_rest[(at_rest % 7 == 3) & (at_rest % 150 > 5)]
    read[counts, 0] = np.where(counts % 2, 0.05, -0.05)
    found = direction_of(read)
    assert (found[counts] == 0).all()
    np.testing.assert_array_equal(found[np.abs(read) > 1], np.sign(read[np.abs(read) > 1]))


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


def short_stops(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return speeds, four a second, of an axis that moves at 0.06 to 1 rad/s between short stops, shape (time, 1)."""
    pieces = []
    for _ in range(150):
        top, ramp, hold = rng.choice([0.06, 0.15, 0.5, 1.0]), rng.uniform(0.5, 1.4), rng.uniform(1, 8)
        t = np.arange(0, hold + 2 * ramp, 0.01)
        inside = np.minimum(np.minimum(t, hold + 2 * ramp - t) / ramp, 1)
        dwell = np.zeros(int(rng.choice([0, 0, 1.2, 2.5]) / 0.01))
        pieces += [rng.choice([-1, 1]) * top * np.sin(np.pi / 2 * inside) ** 2, dwell]
    return np.concatenate(pieces)[::25, None]


@pytest.mark.parametrize("seed", range(4))
def test_ramps_that_are_sampled_coarsely_are_no_noise(seed: int) -> None:
    """A steady slow motion keeps its direction; a reading beyond zero at a stop is between those of two ramps."""
    rng = np.random.default_rng(seed)
    true = short_stops(rng)
    found = direction_of(np.where(true == 0, 0.0, true + rng.normal(0, 0.003, true.shape)))
    np.testing.assert_array_equal(found[np.abs(true) > 0.03], np.sign(true[np.abs(true) > 0.03]))


@pytest.mark.parametrize("seed", range(4))
def test_noise_shows_beside_ramps_that_are_sampled_coarsely(seed: int) -> None:
    """Its sign at the stops is no direction, and the rest of the motion keeps its own."""
    rng = np.random.default_rng(seed)
    true = short_stops(rng)
    found = direction_of(true + rng.normal(0, 0.003, true.shape))
    assert np.mean(found[true == 0] != 0) < 0.02
    np.testing.assert_array_equal(found[np.abs(true) > 0.03], np.sign(true[np.abs(true) > 0.03]))


def test_noise_that_is_known_is_not_estimated() -> None:
    """Within three standard deviations there is no direction, beyond there is; blanks stay blank."""
    speed = np.array([[0.0, 0.029, -0.029, 0.031, -0.031, 5.0, np.nan]]).T
    np.testing.assert_array_equal(direction_of(speed, std=0.01)[:, 0], [0, 0, 0, 1, -1, 1, np.nan])


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


def test_a_smoothed_speed_has_its_sign_up_to_the_reversal() -> None:
    """Where a reading may have the other sign by its noise; and none where the axis stands for some readings."""
    time = 0.02 * np.arange(4000)
    true = np.where(time % 20 < 5, 0.0, np.sin(np.pi * (time % 20 - 5)))
    read = true + np.random.default_rng(4).normal(0, 0.1, len(time))
    columns = {"t_s": time, "speed_m_s": read, "current_A": np.sign(true)}
    found = build_problem(from_columns(columns), Belt()).covariates["direction"][:, 0]
    moving = true != 0
    assert (
        np.mean(found[moving] == np.sign(true[moving])) > 0.98 > np.mean(np.sign(read[moving]) == np.sign(true[moving]))
    )
    assert np.mean(found[~moving] == 0) > 0.95


class Encoder(Belt):
    """A belt whose angle, and whose acceleration, are measured."""

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return the speed and what of the motion was recorded."""
        measured = {name: inputs[name] for name in ("wheel_angle", "wheel_acceleration") if name in inputs}
        return {"wheel_speed": inputs["speed_m_s"], **measured}


def turning(**columns: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return the covariates of an axis that turns with 2 rad/s, with these columns measured."""
    table = {"t_s": 0.1 * np.arange(200), "speed_m_s": np.full(200, 2.0), "current_A": np.ones(200), **columns}
    return dict(build_problem(from_columns(table), Encoder()).covariates)


@pytest.mark.parametrize("name", ["wheel_angle", "wheel_acceleration"])
def test_what_a_class_returns_of_the_motion_is_not_computed_from_the_speed(name: str) -> None:
    """An encoder knows the angle better than an integrated speed does."""
    measured = np.random.default_rng(3).normal(size=200)
    np.testing.assert_array_equal(turning(**{name: measured})[name][:, 0], measured)


def test_blanks_of_a_measured_angle_are_bridged() -> None:
    """No reading is lost for them."""
    angle = 0.3 * np.arange(200)
    blank = np.where(np.arange(200) % 7 == 2, np.nan, angle)
    np.testing.assert_allclose(turning(wheel_angle=blank)["wheel_angle"][:, 0], angle)


def test_an_angle_that_never_changes_is_integrated_from_the_speed() -> None:
    """Nor is one that is blank throughout known."""
    for measured in (np.full(200, 4.0), np.full(200, np.nan)):
        np.testing.assert_allclose(turning(wheel_angle=measured)["wheel_angle"][:, 0], 0.2 * np.arange(200))


def test_a_measured_angle_is_a_position_too() -> None:
    """An integrated one is none: it does not know where the machine began."""
    measured = 0.3 * np.arange(200)
    np.testing.assert_array_equal(turning(wheel_angle=measured)["position"][:, 0], measured)
    assert "position" not in turning()


def test_blanks_of_a_measured_acceleration_follow_from_the_speed() -> None:
    """A speed that is constant has none."""
    measured = np.where(np.arange(200) < 50, np.nan, 1.0)
    found = turning(wheel_acceleration=measured)["wheel_acceleration"][:, 0]
    np.testing.assert_array_equal(found, np.nan_to_num(measured))


class Hoist(Simulation):
    """A hoist whose force follows from its load; only covariates read the motion."""

    channel, unit = "force_N", "N"
    inputs = ("load_N",)
    parameters: ClassVar = {"share": Prior(1.0, 0.01, "1")}

    def __init__(self, *motion: str) -> None:
        self.motion = motion

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the load's force."""
        return values["share"] * inputs["load_N"]

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return what is known of the motion."""
        return {name: inputs[name] for name in self.motion}


@pytest.mark.parametrize(
    ("motion", "known"),
    [(("wheel_speed",), 0.4), (("wheel_speed",), 0.0), (("wheel_speed", "wheel_angle"), 0.4), (("wheel_angle",), 0.0)],
)
def test_a_motion_that_is_hardly_known_is_compared_without_it(motion: tuple[str, ...], known: float) -> None:
    """A speed that is blank for most of the recording, or throughout, or not there at all, costs no reading."""
    time_s, random = 0.1 * np.arange(600), np.random.default_rng(4)
    speed = np.where(time_s < known * time_s[-1], np.sin(time_s), np.nan)
    load = 50 + 20 * np.sin(0.27 * time_s)
    columns = {"t_s": time_s, "load_N": load, "force_N": load + random.normal(0, 2, len(time_s))}
    columns |= {"wheel_speed": speed, "wheel_angle": 1 - np.cos(time_s)}
    answer = compare(columns, Hoist(*motion)).answer
    assert (answer.verdict, answer.left_out) == ("consistent", ())
    sizes = {each.name: each.smallest_detectable for each in answer.sensitivity}
    assert sizes["coulomb-friction"] == sizes["rotor-inertia"] == sizes["wheel-angle-ripple"] == np.inf
