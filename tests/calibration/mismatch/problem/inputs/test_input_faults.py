"""Faults of single readings in inputs and covariates become blanks; pulses that were there stay."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.inputs.input_faults import (
    excursions,
    far_from_all_others,
    far_from_both_neighbours,
    without_input_faults,
)
from regolithd.calibration.mismatch.thresholds import Thresholds

Array = NDArray[np.float64]
LIMITS = Thresholds()
COUNT = 2000
FAULTS = {300: 0.0, 700: 9999.0, 1500: 65535.0}
"""Readings of the flow that were lost, and what the logger wrote."""


def recorded(faults: dict[int, float], pulse: float = 0.0, seed: int = 5) -> Recording:
    """Return a heater's recording: the flow as read, a valve that opens once, and a temperature that has a state."""
    random = np.random.default_rng(seed)
    flow = 20 + 5 * np.sin(np.arange(COUNT) / 60) + random.normal(0, 0.1, COUNT)
    valve = np.zeros(COUNT)
    valve[1000] = pulse
    level = levels(flow, valve) + random.normal(0, 0.3, COUNT)
    flow[list(faults)] = list(faults.values())
    room = 15 + random.normal(0, 0.1, COUNT)
    columns = {"t_s": np.arange(COUNT) * 1.0, "level_cm": level, "flow": flow, "valve": valve, "room_degC": room}
    return from_columns(columns)


def levels(flow: Array, valve: Array) -> Array:
    """Return the level of a tank that flow and valve fill, by steps of a second."""
    level = np.empty(len(flow))
    now = 40.0
    for step, (into, more) in enumerate(zip(flow, valve, strict=True)):
        now += 0.05 * (into + more) - 0.025 * now
        level[step] = now
    return level


def tank(recording: Recording) -> Array:
    """Simulate the recording; blanks are on straight lines, as the tool bridges them."""
    flow, valve = (recording.channels[name][:, 0] for name in ("flow", "valve"))
    known, step = np.isfinite(flow) & np.isfinite(valve), np.arange(COUNT)
    return levels(np.interp(step, step[known], flow[known]), np.interp(step, step[known], valve[known]))[:, None]


def test_how_far_a_reading_lies_beyond_both_neighbours() -> None:
    """By the smaller of both; over blanks; of equal ones together; 0 on a ramp, at a step, and at a run's ends."""
    values = np.array([0.0, 5.0, 1.0, np.nan, -3.0, 2.0, 3.0, 4.0, 4.0, 9.0, 9.0])
    run = np.zeros(len(values), np.int64)
    np.testing.assert_array_equal(excursions(values, run), [0, 4, 0, 0, 4, 0, 0, 0, 0, 0, 0])
    lost = np.array([5.0, 0.0, 0.0, np.nan, 0.0, 6.0, *[0.0] * 6, 5.0])
    np.testing.assert_array_equal(excursions(lost, np.zeros(13, np.int64)), [0, 5, 5, 0, 5, 6, *[0] * 7])
    np.testing.assert_array_equal(excursions(values, (np.arange(11) > 1).astype(np.int64))[:3], [0, 0, 0])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("kind", ["noise", "slow", "levels", "constant"])
def test_sound_columns_have_no_faults(kind: str, seed: int) -> None:
    """White and slow noise, levels that last, and what never changes."""
    random = np.random.default_rng(seed)
    white = random.standard_normal(COUNT)
    columns = {
        "noise": white,
        "slow": np.convolve(white, np.exp(-np.arange(50) / 10), "same"),
        "levels": np.repeat(random.integers(0, 5, COUNT // 50), 50).astype(np.float64),
        "constant": np.full(COUNT, 3.0),
    }
    assert not far_from_all_others(columns[kind][:, None], np.zeros(COUNT, np.int64), LIMITS).any()


def test_the_neighbour_of_a_fault_is_none() -> None:
    """A good reading beside a zero lies far from it, and by chance a little beyond the next."""
    values = 1400 + np.random.default_rng(2).normal(0, 3, (COUNT, 1))
    values[500], values[501] = 0.0, 1460.0
    found = far_from_both_neighbours(values, np.zeros(COUNT, np.int64), LIMITS)
    assert np.flatnonzero(found).tolist() == [500, 501]  # 60 above the next, which is 20 deviations
    values[501] = 1405.0
    found = far_from_both_neighbours(values, np.zeros(COUNT, np.int64), LIMITS)
    assert np.flatnonzero(found).tolist() == [500]


def test_a_code_in_a_row_is_found() -> None:
    """Up to five readings out of the range of all others."""
    values = 20 + np.random.default_rng(2).normal(0, 1, (COUNT, 1))
    values[500:503] = 850.0
    assert np.flatnonzero(far_from_all_others(values, np.zeros(COUNT, np.int64), LIMITS)).tolist() == [500, 501, 502]
    values[500:506] = 850.0
    assert not far_from_all_others(values, np.zeros(COUNT, np.int64), LIMITS).any()


def test_equal_readings_in_a_row_are_a_fault_within_the_range_of_others() -> None:
    """Three zeros of a flow that is zero elsewhere, too, and did not stop there; a stop that the level shows stays."""
    flow = recorded({}).channels["flow"].copy()
    flow[:100, 0] = np.linspace(0, 20, 100)
    stopping = flow.copy()
    stopping[300:303] = 0.0
    noise = np.random.default_rng(4).normal(0, 0.3, (COUNT, 1))
    ran, stopped = (tank(recorded({}).with_channels(flow=each)) + noise for each in (flow, stopping))
    found = without_input_faults(recorded({}).with_channels(flow=stopping, level_cm=ran), "level_cm", tank, LIMITS)
    assert np.flatnonzero(np.isnan(found.channels["flow"])).tolist() == [300, 301, 302]
    given = recorded({}).with_channels(flow=stopping, level_cm=stopped)
    assert without_input_faults(given, "level_cm", tank, LIMITS) is given


def test_faults_of_an_input_become_blanks_and_are_told() -> None:
    """Their times and values are in a note; all other readings stay."""
    recording = recorded(FAULTS)
    found = without_input_faults(recording, "level_cm", tank, LIMITS)
    assert np.flatnonzero(np.isnan(found.channels["flow"])).tolist() == list(FAULTS)
    assert found.channels["valve"] is recording.channels["valve"]
    assert found.notes[len(recording.notes) :] == (
        (
            "3 readings of flow, far from those before and after, are taken as blank: "
            "0 at 300 s, 9999 at 700 s, 65535 at 1500 s."
        ),
    )


def test_a_pulse_that_was_there_stays() -> None:
    """The valve opened for a second, and the level shows it; a fault that says so does not show in the level."""
    recording = recorded({}, pulse=400.0)
    assert without_input_faults(recording, "level_cm", tank, LIMITS) is recording
    claimed = np.zeros((COUNT, 1))
    claimed[1000] = 400.0
    found = without_input_faults(recorded({}).with_channels(valve=claimed), "level_cm", tank, LIMITS)
    assert np.flatnonzero(np.isnan(found.channels["valve"])).tolist() == [1000]


def test_a_pulse_that_changes_nothing_stays_within_the_range_of_others() -> None:
    """An acceleration for one reading, now and then, is no fault where the simulation has none; 850 degrees are."""
    recording = recorded({})
    rate = np.random.default_rng(8).normal(0, 0.01, (COUNT, 1))
    rate[[200, 900, 1700]] = [[1.0], [-1.0], [1.2]]
    room = recording.channels["room_degC"].copy()
    room[1234] = 850.0
    given = recording.with_channels(rate=rate, room_degC=room)
    found = without_input_faults(given, "level_cm", tank, LIMITS)
    assert found.channels["rate"] is rate
    assert np.flatnonzero(np.isnan(found.channels["room_degC"])).tolist() == [1234]


def test_a_fault_with_which_there_is_no_prediction_is_one_out_of_range() -> None:
    """The root of a negative flow is no number."""

    def root(recording: Recording) -> Array:
        return np.sqrt(recording.channels["flow"])

    recording = recorded({400: -9999.0})
    measured = np.sqrt(np.abs(recorded({}).channels["flow"]))
    with np.errstate(invalid="ignore"):
        found = without_input_faults(recording.with_channels(level_cm=measured), "level_cm", root, LIMITS)
    assert np.isnan(found.channels["flow"][400, 0])
