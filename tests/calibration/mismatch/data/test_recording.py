"""Recordings: order and origin carry no meaning; faults of the table are noted or refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rover_drives import columns

from regolithd.calibration.mismatch.data.recording import from_columns, read_recording
from regolithd.calibration.mismatch.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

TABLE = columns(length_s=60.0)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), origin=st.floats(-1e5, 1e5))
def test_order_of_rows_and_origin_of_time_mean_nothing(seed: int, origin: float) -> None:
    """The arrays are the same to the last bit for shuffled rows, and times to a nanosecond for another origin."""
    order = np.random.default_rng(seed).permutation(len(TABLE["t_s"]))
    moved = {name: values[order] for name, values in TABLE.items()}
    moved["t_s"] = moved["t_s"] + origin
    one, other = from_columns(TABLE), from_columns(moved)
    assert one.wheels == other.wheels
    np.testing.assert_allclose(one.time_s, other.time_s, atol=2e-9)
    for name, values in one.channels.items():
        np.testing.assert_array_equal(values, other.channels[name])


def test_repeated_rows_are_averaged_and_said() -> None:
    """A second reading of one instant and wheel counts as much as the first."""
    twice = {name: np.concatenate((values[:6], values)) for name, values in TABLE.items()}
    twice["load_N"][:6] += 2.0
    found = from_columns(twice)
    np.testing.assert_allclose(found.channels["load_N"][0], TABLE["load_N"][:6] + 1.0)
    assert any("6 rows with the same t_s and wheel" in note for note in found.notes)


def test_a_second_column_of_time_is_said() -> None:
    """Seconds are the time; minutes beside them are a channel, whatever they say."""
    found = from_columns({**TABLE, "t_min": TABLE["t_s"]})
    np.testing.assert_array_equal(found.time_s, from_columns(TABLE).time_s)
    assert "The time is t_s. Also named as a time, and read as a channel: t_min." in found.notes


def test_a_clock_that_jumps_back_begins_another_run() -> None:
    """Nothing is mixed: both halves keep all their instants."""
    jumped = {name: values.copy() for name, values in TABLE.items()}
    half = len(jumped["t_s"]) // 2
    jumped["t_s"][half:] -= 20.0
    found = from_columns(jumped)
    assert len(np.unique(found.run)) == 2
    assert found.shape == from_columns(TABLE).shape
    assert any("jumps back" in note for note in found.notes)


def test_gaps_silence_and_constants_are_said() -> None:
    """Each fault has its sentence."""
    kept = (TABLE["t_s"] < 20) | (TABLE["t_s"] > 40)
    table = {name: values[kept].copy() for name, values in TABLE.items()}
    table["bus_voltage_V"][:] = 24.0
    table["yaw_rate_rad_s"][:] = np.nan
    table["load_N"][table["wheel"] == 3] = np.nan
    told = " ".join(from_columns(table).notes)
    for part in (
        "1 gap,",
        "bus_voltage_V is constant",
        "yaw_rate_rad_s was never",
        "load_N was never measured at wheel 3",
    ):
        assert part in told


def test_blank_fields_and_missing_columns_are_not_measured(tmp_path: Path) -> None:
    """A blank is NaN; a column that is not there is NaN everywhere."""
    path = tmp_path / "short.csv"
    path.write_text("t_s,wheel,motor_current_A,load_N\n0,1,0.02,\n0.2,1,,30\n0.4,1,0.03,31\n")
    found = read_recording(path)
    np.testing.assert_array_equal(np.isnan(found.channel("load_N")[:, 0]), [True, False, False])
    assert np.isnan(found.channel("pitch_rad")).all()


@pytest.mark.parametrize("text", ["", "wheel\n1\n", "t_s,wheel\nlong ago,1\n", "t_s,wheel,load_N\n0,1,3\n"])
def test_what_is_no_recording_is_refused_with_a_reason(tmp_path: Path, text: str) -> None:
    """One error, and it tells what is wrong."""
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(RecordingError, match=r"."):
        read_recording(path)


def test_a_rate_of_change_does_not_reach_across_runs() -> None:
    """Each run is differentiated by itself; one instant alone has no rate."""
    table = {
        "t_s": np.array([0.0, 1.0, 2.0, 0.0, 2.0, 4.0, 0.0]),
        "run": np.array([1, 1, 1, 2, 2, 2, 3]),
        "speed_rpm": np.array([0.0, 3.0, 6.0, 100.0, 90.0, 80.0, 7.0]),
    }
    found = from_columns(table)
    rate = found.rate_of_change(found.channel("speed_rpm"))
    np.testing.assert_allclose(rate[:, 0], [3.0, 3.0, 3.0, -5.0, -5.0, -5.0, np.nan])
