"""Channels sampled less often than the rows are known between their readings, and nothing else is filled in."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.data.slow_channels import bridged, drawn_between, filled_between

TIME_S = 0.01 * np.arange(1000)


def recorded(**channels: np.ndarray) -> Recording:
    """Return a recording at 100 Hz with these channels."""
    return from_columns({"t_s": TIME_S, **channels})


def every(step: int, values: np.ndarray) -> np.ndarray:
    """Return the values at every n-th row, blank elsewhere."""
    return np.where(np.arange(len(values)) % step == 0, values, np.nan)


def test_a_sensor_at_one_hertz_is_interpolated_between_its_readings() -> None:
    """A straight line is recovered exactly up to the last reading."""
    line = 20 + 3 * TIME_S
    found = filled_between(recorded(temperature_degC=every(100, line), current_A=np.sin(TIME_S)), "current_A", {})
    np.testing.assert_allclose(found.channels["temperature_degC"][:901, 0], line[:901])
    assert np.isnan(found.channels["temperature_degC"][901:]).all()
    assert any("temperature_degC" in note for note in found.notes)


def test_a_held_channel_keeps_its_last_reading() -> None:
    """Between two readings the value is that of the first."""
    found = filled_between(recorded(mode=every(100, np.floor(TIME_S)), y=TIME_S), "y", {"mode": "hold"})
    np.testing.assert_array_equal(found.channels["mode"][:901, 0], np.floor(TIME_S[:901] + 1e-9))


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_blanks_of_a_channel_that_usually_reports_stay_blank(share: float) -> None:
    """Random blanks are not measured, and nothing is invented for them."""
    values = np.where(np.random.default_rng(1).random(1000) < share, np.nan, 1.0 + TIME_S)
    found = filled_between(recorded(yaw_rate_rad_s=values, y=TIME_S), "y", {})
    np.testing.assert_array_equal(np.isnan(found.channels["yaw_rate_rad_s"][:, 0]), np.isnan(values))


def test_a_long_gap_of_a_slow_channel_stays_blank() -> None:
    """Beyond three of its own periods a value is not known."""
    slow = every(10, TIME_S)
    slow[200:500] = np.nan
    found = filled_between(recorded(slow=slow, y=TIME_S), "y", {}).channels["slow"][:, 0]
    assert np.isnan(found[200:495]).all()
    assert np.isfinite(found[:190]).all()


def test_the_predicted_channel_and_a_channel_declared_blank_are_left_alone() -> None:
    """What is compared is what was measured."""
    slow = every(10, TIME_S)
    found = filled_between(recorded(y=slow, x=slow), "y", {"x": "blank"})
    np.testing.assert_array_equal(found.channels["y"][:, 0], slow)
    np.testing.assert_array_equal(found.channels["x"][:, 0], slow)


BLANKS = np.array([np.nan, 1.0, np.nan, np.nan, 4.0, np.nan, np.nan, 20.0, np.nan, 30.0])
TWO_RUNS = np.repeat([0.0, 1.0], 5)
TIMES = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 0.0, 1.0, 2.0, 3.0, 6.0])
LINE = np.array([1.0, 1.0, 2.0, 3.0, 4.0, 20.0, 20.0, 20.0, 22.5, 30.0])
HELD = np.array([1.0, 1.0, 1.0, 1.0, 4.0, 20.0, 20.0, 20.0, 20.0, 30.0])


@pytest.mark.parametrize(
    ("between", "other_way", "expected"),
    [({}, False, LINE), ({"x": "linear"}, True, HELD), ({"x": "hold"}, False, HELD), ({"x": "hold"}, True, LINE)],
)
def test_blanks_are_bridged_within_a_run(between: dict[str, str], other_way: bool, expected: np.ndarray) -> None:
    """By time on a straight line or held, and the ends of a run by the reading next to them."""
    recording = from_columns({"t_s": TIMES, "run": TWO_RUNS, "x": BLANKS, "y": TIMES})
    found, blanks = bridged(recording, ["x", "y", "absent"], between, other_way=other_way)  # type: ignore[arg-type]
    np.testing.assert_allclose(found.channels["x"][:, 0], expected)
    assert found.channels["y"] is recording.channels["y"]
    assert set(found.channels) == {"x", "y"}
    assert list(blanks) == ["x"]
    np.testing.assert_array_equal(blanks["x"][:, 0], np.isnan(BLANKS))


def test_what_stays_blank_is_not_said_to_be_bridged() -> None:
    """A channel that is declared blank, one that was never measured, and a run or a wheel without a reading."""
    half = np.where(TWO_RUNS == 1, np.nan, BLANKS)
    recording = from_columns(
        {"t_s": TIMES, "run": TWO_RUNS, "x": BLANKS, "half": half, "none": np.full(10, np.nan), "y": TIMES}
    )
    found, blanks = bridged(recording, ["x", "half", "none"], {"x": "blank"})
    assert list(blanks) == ["half"]
    np.testing.assert_array_equal(blanks["half"][:, 0], [True, False, True, True, False, *[False] * 5])
    np.testing.assert_allclose(found.channels["half"][:, 0], [*LINE[:5], *[np.nan] * 5])
    assert found.channels["x"] is recording.channels["x"]
    assert found.channels["none"] is recording.channels["none"]


def test_channels_after_the_predicted_one_are_filled_too() -> None:
    """The order of the columns means nothing."""
    slow = every(10, TIME_S)
    found = filled_between(recorded(y=TIME_S, x=slow, mode=slow, z=slow), "y", {"mode": "blank"})
    np.testing.assert_allclose(found.channels["x"][:991, 0], TIME_S[:991])
    np.testing.assert_allclose(found.channels["z"][:991, 0], TIME_S[:991])
    np.testing.assert_array_equal(found.channels["mode"][:, 0], slow)


def sampled(values: np.ndarray, period: int) -> Recording:
    """Return a recording with a column that is read at every so many rows."""
    read = np.where(np.arange(len(values)) % period == 0, values, np.nan)
    return from_columns({"t_s": np.arange(float(len(values))), "current_A": np.zeros(len(values)), "speed_m_s": read})


def test_what_is_between_readings_is_in_doubt_as_the_readings_scatter() -> None:
    """Of a random walk, by as much as a straight line is off; of a straight line, not at all; readings are known."""
    random = np.random.default_rng(1)
    walk = np.cumsum(random.normal(size=20001))
    recording = sampled(walk, 10)
    filled = filled_between(recording, "current_A", {})
    drawn, last = drawn_between(recording, filled, "speed_m_s", "linear")
    line = filled.channels["speed_m_s"][:, 0]
    assert np.array_equal(last[:, 0], np.arange(20001) // 10 * 10)
    for row in (1, 5, 8):
        off, true = drawn[row::10, 0] - line[row::10], walk[row::10] - line[row::10]
        assert np.sqrt(np.mean(off**2)) == pytest.approx(np.sqrt(np.mean(true**2)), rel=0.1)
    np.testing.assert_array_equal(drawn[::10, 0], walk[::10])
    straight = sampled(np.arange(101.0), 10)
    drawn, _ = drawn_between(straight, filled_between(straight, "current_A", {}), "speed_m_s", "linear")
    np.testing.assert_allclose(drawn[:, 0], np.arange(101.0))


def test_a_held_mode_is_in_doubt_where_it_changes_next() -> None:
    """Asked for every ten rows, it has changed before it is read; one that is reported when it changes has not."""
    mode = np.where(np.arange(201) < 95, 1.0, 3.0)
    asked = sampled(mode, 10)
    drawn, _ = drawn_between(asked, filled_between(asked, "current_A", {"speed_m_s": "hold"}), "speed_m_s", "hold")
    np.testing.assert_array_equal(drawn[:91, 0], 1.0)
    assert np.all(np.diff(drawn[90:100, 0]) > 0)
    np.testing.assert_array_equal(drawn[100:, 0], 3.0)
    told = sampled(np.arange(201) // 10 % 2 + 1.0, 10)
    filled = filled_between(told, "current_A", {"speed_m_s": "hold"})
    drawn, _ = drawn_between(told, filled, "speed_m_s", "hold")
    np.testing.assert_array_equal(drawn, filled.channels["speed_m_s"])
