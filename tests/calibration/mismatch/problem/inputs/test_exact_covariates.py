"""What smoothing takes of an input that another, exact one shows is put back; what is error stays out."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch import SensorError
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import smoothed_inputs
from regolithd.calibration.mismatch.problem.inputs.exact_covariates import given_exact_covariates

ROWS, ERROR = 3000, 40.0
ERRORS = {"tension": SensorError(absolute=ERROR)}


def tension_of_a_crank(random: np.random.Generator, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a tension that goes up and down with each turn of a crank, which stops at times, and the crank's angle."""
    speed = np.where(np.arange(ROWS) % 500 < 350, step, 0.0)
    angle = np.mod(np.cumsum(speed + 0.2 * random.normal(size=ROWS) * (speed > 0)), 2 * np.pi)
    return 2000 + 400 * np.sin(angle) + 120 * np.cos(2 * angle), angle


def recording(tension: np.ndarray, **others: np.ndarray) -> Recording:
    """Return a recording of these columns at ten readings a second."""
    return from_columns({"t_s": np.arange(ROWS) / 10, "tension": tension, **others})


def completed(recorded: Recording, exact: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return the tension as it was smoothed, and with what exact columns show, shape (time,) each."""
    made = smoothed_inputs(recorded, ERRORS)
    found = given_exact_covariates(recorded, made, ERRORS, exact)
    return made.recording.channels["tension"][:, 0], found.channels["tension"][:, 0]


def largest_mean(error: np.ndarray, angle: np.ndarray) -> float:
    """Return the largest mean of an error over a twelfth of a turn."""
    place = np.floor(12 * angle / (2 * np.pi)).astype(int)
    return float(np.max(np.abs([error[place == k].mean() for k in range(12)])))


def test_a_tension_that_follows_an_angle_keeps_what_it_follows() -> None:
    """A crank that turns by more than a third of a turn from reading to reading: no model of time alone knows it."""
    random = np.random.default_rng(0)
    truth, angle = tension_of_a_crank(random, 2.34)
    smooth, found = completed(recording(truth + ERROR * random.normal(size=ROWS), angle=angle), ("angle",))
    assert largest_mean(smooth - truth, angle) > 0.4 * ERROR
    assert largest_mean(found - truth, angle) < 0.25 * ERROR
    assert np.std(found - truth) < np.std(smooth - truth)


def test_nothing_is_put_back_that_follows_nothing() -> None:
    """An exact column beside it that has nothing to do with it, and none at all."""
    random = np.random.default_rng(1)
    truth = 2000 + 300 * np.sin(np.arange(ROWS) / 200)
    recorded = recording(truth + ERROR * random.normal(size=ROWS), angle=random.uniform(0, 6, ROWS))
    for exact in (("angle",), ()):
        smooth, found = completed(recorded, exact)
        np.testing.assert_array_equal(found, smooth)


def test_a_controller_that_acts_on_the_reading_shows_its_error_and_no_truth() -> None:
    """Its output is exact, and follows the noise of the reading that it acts on."""
    random = np.random.default_rng(2)
    truth = 2000 + 300 * np.sin(np.arange(ROWS) / 200)
    read = truth + ERROR * random.normal(size=ROWS)
    smooth, found = completed(recording(read, brake=0.01 * (2000 - read)), ("brake",))
    assert np.std(read - smooth) > 0.9 * ERROR
    np.testing.assert_array_equal(found, smooth)


def test_a_reading_at_rest_stays_exactly_zero() -> None:
    """Where the readings are exactly 0 nothing is put back, and no estimate changes its sign."""
    random = np.random.default_rng(3)
    truth, angle = tension_of_a_crank(random, 2.34)
    resting = np.arange(ROWS) % 500 >= 350
    read = np.where(resting, 0.0, truth + ERROR * random.normal(size=ROWS))
    smooth, found = completed(recording(read, angle=angle), ("angle",))
    assert not found[resting].any()
    assert np.all(found[~resting] > 0)
    assert np.any(found != smooth)


def test_each_axis_has_its_own_angle() -> None:
    """Two axes with cranks of their own; the tension of one sensor of the whole machine stays the same on both."""
    random = np.random.default_rng(4)
    of_axes = [tension_of_a_crank(random, step) for step in (2.34, 1.9)]
    rows = {
        "t_s": np.repeat(np.arange(ROWS) / 10, 2),
        "wheel": np.tile([1, 2], ROWS),
        "tension": np.stack([truth + ERROR * random.normal(size=ROWS) for truth, _ in of_axes], axis=1).ravel(),
        "angle": np.stack([angle for _, angle in of_axes], axis=1).ravel(),
    }
    recorded = from_columns(rows)
    found = given_exact_covariates(recorded, smoothed_inputs(recorded, ERRORS), ERRORS, ("angle",))
    for axis, (truth, angle) in enumerate(of_axes):
        assert largest_mean(found.channels["tension"][:, axis] - truth, angle) < 0.25 * ERROR
    shared = from_columns(
        {**rows, "tension": np.repeat(rows["tension"][::2], 2), "angle": np.repeat(rows["angle"][::2], 2)}
    )
    both = given_exact_covariates(shared, smoothed_inputs(shared, ERRORS), ERRORS, ("angle",)).channels["tension"]
    np.testing.assert_array_equal(both[:, 0], both[:, 1])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_columns_together_tell_of_an_input_that_changes_much(seed: int) -> None:
    """The head of a compressor is a function of its flow and speed: what is left of the error follows neither."""
    random = np.random.default_rng(seed)
    speed = 1 + 0.2 * np.sin(np.arange(ROWS) / 90)
    flow = 1000 * speed * (1 + 0.15 * np.convolve(random.normal(size=ROWS), (0.8, 0.6), "same"))
    head = speed**2 * (1.25 - 0.3 * (flow / speed / 1000) ** 2) * (1 + 0.02 * random.normal(size=ROWS))
    recorded = recording(flow + ERROR * random.normal(size=ROWS), head=head, speed=speed)
    smooth, found = completed(recorded, ("head", "speed"))
    for_speed = head / speed**2
    place = np.searchsorted(np.quantile(for_speed, np.linspace(0, 1, 13)[1:-1]), for_speed)
    before, after = (np.array([(each - flow)[place == k].mean() for k in range(12)]) for each in (smooth, found))
    assert np.sqrt(np.mean(after**2)) < 0.4 * np.sqrt(np.mean(before**2))
    assert np.std(found - flow) < np.std(smooth - flow)
