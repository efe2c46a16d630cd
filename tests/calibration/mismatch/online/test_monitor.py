"""A change is reported while the recording grows, a sound recording stays silent, and what cannot be done is said."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import STEP_S, Drag, Level, table

from regolithd.calibration.mismatch import Prior, SensorError, SimulationError
from regolithd.calibration.mismatch.online.channels import monitors_of
from regolithd.calibration.mismatch.online.left_out import LeftOutCount, LeftOutHere
from regolithd.calibration.mismatch.online.linearised import learned
from regolithd.calibration.mismatch.online.monitor import Monitor, SequentialTest
from regolithd.calibration.mismatch.online.pieces import Cutter
from regolithd.calibration.mismatch.online.report import UNNAMED
from regolithd.calibration.mismatch.online.thresholds import ONLINE_THRESHOLDS, OnlineThresholds

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch import Candidate, Problem, Shape
    from regolithd.calibration.mismatch.online.report import Report

    Columns = dict[str, NDArray[np.float64]]

LIMITS = OnlineThresholds(alarm=20.0, interval_s=40.0, learning_intervals=3)
ONSET_S = 200.0


def recorded(*, offset: float = 0.0, seed: int = 0) -> Columns:
    """Return 400 s of two axes; on axis 2 an offset begins half way."""
    columns = table(seed=seed)
    late = (columns["t_s"] >= ONSET_S) & (columns["axis"] == 2)
    columns["reading_V"] = columns["reading_V"] + offset * late
    del columns["run"]
    return columns


def followed(columns: Mapping[str, NDArray[np.float64]], simulation: Level | None = None) -> list[Report]:
    """Return the reports of a recording, one for each piece."""
    cutter, monitor = Cutter(LIMITS.interval_s, "axis"), Monitor(simulation or Level(), LIMITS)
    return [monitor.add(piece) for part in (cutter.add(columns), cutter.rest()) for piece in part]


def test_a_sound_recording_stays_silent() -> None:
    """No report in ten recordings."""
    assert not [report.changes for seed in range(10) for report in followed(recorded(seed=seed)) if report.changes]


def test_a_change_is_reported_before_the_recording_ends() -> None:
    """With its axis, its onset in the interval, and its size in the interval."""
    reports = followed(recorded(offset=0.3))
    first = next(report for report in reports if report.changes)
    assert ONSET_S < first.time_s < 400.0
    (change,) = reports[-1].changes
    assert change.wheels == (2,)
    assert change.name in {"step", "offset"}
    assert change.onset_low_s is not None
    assert change.onset_high_s is not None
    assert change.onset_low_s <= ONSET_S <= change.onset_high_s
    assert change.low < 0.3 < change.high
    assert change.first_reported_s == first.time_s
    assert "axis 2, since 200 s" in change.statement


class ReadNoisily(Level):
    """The level, of a gain and a speed that is read with an error."""

    inputs = ("speed_rad_s",)
    sensors: ClassVar = {"speed_rad_s": SensorError(absolute=0.2)}
    parameters: ClassVar = {"level_V": Prior(2.0, 0.1, "V"), "gain_V_s": Prior(1.0, 0.02, "V s")}

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the reading, row by row."""
        return values["level_V"] + values["gain_V_s"] * inputs["speed_rad_s"]


def test_inputs_that_are_smoothed_give_a_simulation_no_memory() -> None:
    """In few rows they are smoothed otherwise than in many: that is no state that is carried."""
    columns = recorded()
    rng = np.random.default_rng(5)
    columns["reading_V"] = columns["reading_V"] + columns["speed_rad_s"]
    columns["speed_rad_s"] = columns["speed_rad_s"] + rng.normal(0, 0.2, len(columns["speed_rad_s"]))
    assert not [report.changes for report in followed(columns, ReadNoisily()) if report.changes]


def test_the_first_pieces_are_learned_from() -> None:
    """Nothing is decided before, and the report says so."""
    reports = followed(recorded(offset=0.3))
    assert [report.learning for report in reports[:4]] == [True, True, False, False]
    assert reports[2].compared_intervals == 3


class OnlyDrag(Level):
    """The level, and no other law than a drag."""

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:  # noqa: ARG002
        """Return the drag."""
        return (Drag(),)


def test_a_change_that_does_not_last_is_withdrawn() -> None:
    """A drag that lasts 40 s is reported, and not any longer after minutes without it."""
    columns = recorded()
    brief = (columns["t_s"] >= 160) & (columns["t_s"] < 200) & (columns["axis"] == 2)
    columns["reading_V"] = columns["reading_V"] + 0.15 * brief * np.sign(columns["speed_rad_s"])
    reports = followed(columns, OnlyDrag())
    assert [change.name for change in reports[4].changes] == ["drag"]
    assert not reports[-1].changes


def test_what_no_law_explains_alone_has_no_name() -> None:
    """An offset and a drag that begin together are one change, told once, on its axis since its onset."""
    columns = recorded(offset=0.6)
    late = (columns["t_s"] >= ONSET_S) & (columns["axis"] == 2)
    columns["reading_V"] = columns["reading_V"] - 0.5 * late * np.sign(columns["speed_rad_s"])
    reports = followed(columns)
    names = [change.name for report in reports for change in report.changes]
    assert names.count(UNNAMED) >= len(names) - 1
    (change,) = reports[-1].changes
    assert (change.name, change.wheels, change.onset_s) == (UNNAMED, (2,), ONSET_S)
    assert "not known what" in change.statement
    assert change.size == pytest.approx(np.hypot(0.6, 0.5), rel=0.3)


def test_a_change_beside_one_without_a_name_is_still_reported() -> None:
    """On the other axis, with its name."""
    columns = recorded(offset=0.6)
    sign, axis = np.sign(columns["speed_rad_s"]), columns["axis"]
    columns["reading_V"] = columns["reading_V"] - 0.5 * ((columns["t_s"] >= ONSET_S) & (axis == 2)) * sign
    columns["reading_V"] = columns["reading_V"] + 0.5 * ((columns["t_s"] >= 280.0) & (axis == 1)) * sign
    told = {change.wheels: change.name for change in followed(columns)[-1].changes}
    assert told == {(2,): UNNAMED, (1,): "drag"}


@pytest.mark.parametrize("seed", [124, 125, 126, 127, 128, 136, 140, 141])
def test_changes_that_no_law_explains_on_all_axes_are_told_and_end_nothing(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two changes that began together, and had no name together, took turns: the decision never ended."""
    rng, columns = np.random.default_rng(seed), recorded(seed=seed)
    speed, t_s = columns["speed_rad_s"], columns["t_s"]
    for axis in (1, 2):
        late = (columns["axis"] == axis) & (t_s >= ONSET_S + rng.choice([-20.0, 0.0, 20.0]))
        for course in (np.ones_like(speed), np.sign(speed), np.abs(speed), speed**2, np.sin(t_s / rng.uniform(2, 30))):
            columns["reading_V"] = columns["reading_V"] + rng.normal() * rng.choice([0.3, 1.0, 3.0]) * late * course
    taken = []
    take_name = SequentialTest._take_name  # counts, so that the test fails and does not hang

    def counted(test: SequentialTest, index: int) -> None:
        taken.append(index)
        assert len(taken) < 200
        take_name(test, index)

    monkeypatch.setattr(SequentialTest, "_take_name", counted)
    reports = followed(columns)
    assert reports[-1].changes
    assert all(change.onset_s <= 260.0 for change in reports[-1].changes)


def test_a_gap_is_told_and_bridged() -> None:
    """The pieces without rows are not compared, with the reason, and the change after them is found."""
    columns = recorded(offset=0.4)
    gap = (columns["t_s"] >= 160) & (columns["t_s"] < 240)
    reports = followed({name: values[~gap] for name, values in columns.items()})
    assert [report.not_compared for report in reports].count("nothing was recorded") == 2
    assert reports[-1].changes[0].wheels == (2,)


def test_a_missing_input_is_told() -> None:
    """Pieces in which the speed is blank are not compared, and named."""
    columns = recorded()
    blank = (columns["t_s"] >= 240) & (columns["t_s"] < 360)
    columns["speed_rad_s"] = np.where(blank, np.nan, columns["speed_rad_s"])
    told = [report.not_compared for report in followed(columns)]
    assert any("speed_rad_s" in text for text in told)
    assert told[-1] == ""


def test_the_report_is_json() -> None:
    """With the leading statistic and its threshold."""
    told = followed(recorded(offset=0.3))[-1].to_json()
    assert told["alarm"] == LIMITS.alarm
    assert told["changes"][0]["statistic"] > LIMITS.alarm


class Integrated(Level):
    """A simulation that adds up its input since the start."""

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the level and the angle that was turned so far."""
        return values["level"] + np.cumsum(np.abs(inputs["speed_rad_s"]), axis=0) * STEP_S


def test_a_simulation_that_carries_its_state_far_is_refused() -> None:
    """It says why, and what to do."""
    with pytest.raises(SimulationError, match="Compare the whole recording with `regolithd mismatch`"):
        followed(recorded(), Integrated())


class TwoChannels(Level):
    """The same reading twice."""

    channels: Mapping[str, str] = {"reading_V": "V", "other_V": "V"}  # type: ignore[misc]


def test_several_channels_have_a_monitor_each() -> None:
    """With a threshold that keeps the rate of false reports over all of them."""
    found = monitors_of(TwoChannels(), LIMITS)
    assert list(found) == ["reading_V", "other_V"]
    piece = next(Cutter(1.0, "axis").add(recorded()))
    assert found["other_V"].add(piece).alarm == pytest.approx(LIMITS.alarm + 2 * np.log(2))


def test_each_threshold_says_what_it_decides_and_how_it_was_found() -> None:
    """In words, with the value in use."""
    for row in ONLINE_THRESHOLDS.table():
        assert len(row.meaning) > 20
        assert len(row.found) > 20, row.name
        assert row.value == getattr(ONLINE_THRESHOLDS, row.name)


def test_what_is_not_compared_counts_nowhere() -> None:
    """A blank reading takes no part in the sums: not by its residual, and not by the columns beside it."""
    columns = recorded()
    columns["reading_V"][100:160] = np.nan
    pieces = list(Cutter(LIMITS.interval_s, "axis").add(columns))
    _, intervals = learned(pieces[:3], Level())
    blank = [~interval.mask for interval in intervals]
    assert any(np.any(each) for each in blank)
    for interval, nowhere in zip(intervals, blank, strict=True):
        assert not np.any(interval.columns[:, nowhere])
        assert not np.any(interval.residual[nowhere])


class Warm(Drag):
    """An offset that grows with a temperature."""

    name, covariate = "warm", "heat"

    def columns(self, problem: Problem, shape: Shape) -> NDArray[np.float64]:  # noqa: ARG002
        """Return the temperature."""
        return np.asarray(problem.covariates["heat"])[None]


class WithHeat(Level):
    """The level, and a temperature where it is read."""

    def covariates(self, inputs: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        """Return speed, time and temperature."""
        return {**super().covariates(inputs), "heat": inputs["heat_degC"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return the law of temperature as well."""
        return (*super().candidates(library), Warm())


def test_a_covariate_that_ends_ends_nothing_else() -> None:
    """What depends on it is not looked for; a change that begins later is reported."""
    columns = recorded(offset=0.4)
    heat = 20.0 + 5.0 * np.sin(columns["t_s"] / 50)
    columns["heat_degC"] = np.where(columns["t_s"] < 160, heat, np.nan)
    reports = followed(columns, WithHeat())
    assert not any(report.not_compared for report in reports)
    assert [change.wheels for change in reports[-1].changes] == [(2,)]


class Slope(Level):
    """A reading that grows with the speed."""

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the level and twice the speed."""
        return values["level"] + 2.0 * inputs["speed_rad_s"]


def test_a_wheel_without_an_input_is_told_when_it_has_lasted() -> None:
    """With its input, since when, and how many readings; not in its first interval."""
    columns = recorded()
    blank = (columns["t_s"] >= ONSET_S) & (columns["axis"] == 2)
    columns["speed_rad_s"] = np.where(blank, np.nan, columns["speed_rad_s"])
    reports = followed(columns)
    told = {report.time_s: report.left_out_readings for report in reports}
    assert told[200.0] == ()
    assert [each.since_s for each in told[240.0]] == [None]
    (last,) = reports[-1].left_out_readings
    assert (last.wheel, last.reason, last.since_s) == (2, "speed_rad_s was not measured", ONSET_S)
    assert last.readings == blank.sum()
    assert last.statement("axis") == "axis 2 is not compared since 200 s: speed_rad_s was not measured"


def test_a_wheel_without_readings_is_told() -> None:
    """Also when its rows are no longer there."""
    columns = recorded()
    kept = (columns["t_s"] < ONSET_S) | (columns["axis"] == 1)
    reports = followed({name: values[kept] for name, values in columns.items()})
    (last,) = reports[-1].left_out_readings
    assert (last.wheel, last.reason, last.since_s) == (2, "reading_V was not measured", ONSET_S)


@pytest.mark.parametrize("since_s", [ONSET_S, 236.0])
def test_a_reading_that_stays_the_same_is_told_as_that(since_s: float) -> None:
    """Not as an effect: also where it begins too late in an interval to be seen there."""
    columns = recorded()
    moving = columns["speed_rad_s"] * 2.0
    columns["reading_V"] = columns["reading_V"] + moving
    late = (columns["t_s"] >= since_s) & (columns["axis"] == 2)
    columns["reading_V"] = np.where(late, 0.0, columns["reading_V"])
    reports = followed(columns, Slope())
    assert not reports[-1].changes
    (last,) = reports[-1].left_out_readings
    assert "stays exactly the same" in last.reason
    assert last.since_s == since_s


def test_a_coarse_reading_is_not_stuck() -> None:
    """One in steps as large as its noise, which often repeats."""
    columns = recorded()
    columns["reading_V"] = np.round(columns["reading_V"])
    assert not any(report.left_out_readings for report in followed(columns))


def test_what_is_over_is_counted_and_not_lasting() -> None:
    """After an interval in which the wheel is compared."""
    count = LeftOutCount(("a",), LIMITS)
    for _ in range(3):
        count.add([LeftOutHere(0, "blank", 50, 0.9, 7.0)])
    assert [each.since_s for each in count.table()] == [7.0]
    count.add([])
    assert [(each.since_s, each.readings) for each in count.table()] == [(None, 150)]
