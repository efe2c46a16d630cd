"""Every fault of a table has its sentence, and the numbers in it; the arrays are those of the contract."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from regolithd.calibration.mismatch.data.recording import Recording, from_columns, read_recording
from regolithd.calibration.mismatch.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def table(times: list[float], wheels: tuple[int, ...] = (1, 2), **changes: Array) -> dict[str, Array]:
    """Return a long table with one channel that counts the rows."""
    count = len(times) * len(wheels)
    made = {
        "t_s": np.repeat(times, len(wheels)),
        "wheel": np.tile(wheels, len(times)),
        "value": np.arange(1.0, count + 1),
    }
    return {name: np.asarray(values, float) for name, values in (made | changes).items()}


def test_rows_become_time_by_wheel() -> None:
    """Time starts at 0; wheels are in ascending order; without the columns there is one wheel and one run."""
    found = from_columns(table([100.0, 100.5, 101.0], wheels=(4, 2)))
    assert (found.wheels, found.shape, found.step_s) == ((2, 4), (3, 2), 0.5)
    np.testing.assert_array_equal(found.time_s, [0.0, 0.5, 1.0])
    np.testing.assert_array_equal(found.channels["value"], [[2, 1], [4, 3], [6, 5]])
    assert set(found.channels) == {"value"}
    assert found.notes == ()
    alone = from_columns({"t_s": np.arange(3.0), "value": np.arange(3.0)})
    assert (alone.wheels, alone.shape, alone.run.tolist()) == ((1,), (3, 1), [0, 0, 0])


def test_the_usual_step_is_the_median_within_runs() -> None:
    """1 s where there is none."""
    run = np.array([0, 0, 0, 1, 1])
    assert Recording(np.array([0.0, 0.2, 0.4, 0.0, 0.3]), run, (1,), {}).step_s == pytest.approx(0.2)
    assert Recording(np.array([0.0, 0.0]), np.array([0, 1]), (1,), {}).step_s == 1.0


def test_rows_without_time_or_wheel_are_left_out() -> None:
    """Their number is in the note."""
    broken = table([0.0, 1.0, 2.0])
    broken["t_s"][0] = broken["wheel"][3] = np.nan
    found = from_columns(broken)
    assert found.notes[0] == "2 rows without t_s or wheel: left out."
    assert "Instants without a row, counted for each wheel: 2 of 6." in found.notes
    assert np.isnan(found.channels["value"][0, 0])


def test_repeated_rows_are_counted_and_averaged() -> None:
    """Three rows of one instant and wheel are two too many; a blank does not count in the mean."""
    rows = table([0.0, 1.0])
    extra = {name: np.append([values[0]] * 3, values) for name, values in rows.items()}
    extra["value"][:3] = (4.0, 7.0, np.nan)
    found = from_columns(extra)
    assert found.channels["value"][0, 0] == pytest.approx((1 + 4 + 7) / 3)
    assert "3 rows with the same t_s and wheel as another: the mean is taken." in found.notes


def test_times_that_agree_to_a_nanosecond_are_one_instant() -> None:
    """Rounding of the text is no second instant; two nanoseconds are."""
    rows = table([0.0, 1.0])
    rows["t_s"][1] += 4e-10
    assert from_columns(rows).shape == (2, 2)
    rows["t_s"][1] += 2e-9
    assert from_columns(rows).shape == (3, 2)


@pytest.mark.parametrize(("jumps", "runs"), [(1, 2), (3, 4), (4, 1)])
def test_a_clock_that_jumps_back_up_to_three_times_begins_new_runs(jumps: int, runs: int) -> None:
    """More jumps are rows out of order, which are sorted."""
    times = [100.0 * (jumps - part) + step for part in range(jumps + 1) for step in (0.0, 1.0, 2.0)]
    found = from_columns(table(times))
    assert len(set(found.run.tolist())) == runs
    if runs == 1:
        assert "Rows are not in the order of time; they are sorted." in found.notes
    else:
        first = f"The clock jumps back {jumps} time{'s' if jumps > 1 else ''}, first at {100 * jumps + 2:.1f} s; "
        assert first + "what follows is taken as another run." in found.notes
        np.testing.assert_array_equal(found.time_s, [0.0, 1.0, 2.0] * runs)


def test_runs_that_are_given_are_kept_beside_those_of_the_clock() -> None:
    """A jump from one given run to the next is none; one inside a run splits it."""
    rows = table([5.0, 6.0, 0.0, 1.0, 2.0, 0.5])
    rows["run"] = np.repeat([1.0, 1, 2, 2, 2, 2], 2)
    found = from_columns(rows)
    assert found.run.tolist() == [4, 4, 8, 8, 8, 9]
    rows["run"] = np.repeat([1.0, 1, 2, 2, 2, 3], 2)
    assert from_columns(rows).run.tolist() == [1, 1, 2, 2, 2, 3]


@pytest.mark.parametrize(("gap_s", "noted"), [(5.0, False), (5.1, True)])
def test_a_gap_is_longer_than_five_usual_steps(gap_s: float, noted: bool) -> None:
    """All gaps are counted, with their length."""
    times = np.cumsum([0.0, 1, 1, 1, gap_s, 1, 1, gap_s, 1, 1, 1]).tolist()
    notes = from_columns(table(times)).notes
    expected = "2 gaps, 10.2 s in all; nothing is assumed about what happened in between."
    assert (expected in notes) == noted
    assert len(notes) == int(noted)


def test_channels_that_cannot_show_anything_are_noted() -> None:
    """Never measured, at some wheels or at all; constant, with its value."""
    count = 6
    rows = table(
        [0.0, 1.0, 2.0],
        never=np.full(count, np.nan),
        one=np.where(np.arange(count) % 2, np.nan, np.arange(count)),
        constant=np.full(count, 24.5),
    )
    assert from_columns(rows).notes == (
        "never was never measured.",
        "one was never measured at wheel 2.",
        "constant is constant (24.5): nothing that depends on it can show.",
    )
    rows["axis"] = rows.pop("wheel")
    assert "one was never measured at axis 2." in from_columns(rows, unit="axis").notes


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({}, "there is no column of time (t_s, t_ms, t_us, t_ns, t_min, t_h); the table has nothing"),
        (
            {"x": [1.0], "y": [1.0]},
            "there is no column of time (t_s, t_ms, t_us, t_ns, t_min, t_h); the table has x, y",
        ),
        ({"t_s": []}, "the recording has no rows"),
        ({"t_s": [np.nan]}, "no row has both t_s and wheel"),
        ({"t_s": [1.0, 1.0]}, "the recording has only one instant: all its times t_s are the same"),
    ],
)
def test_a_table_without_two_instants_is_refused(columns: dict[str, list[float]], message: str) -> None:
    """The error says what is there."""
    with pytest.raises(RecordingError, match=f"^{re.escape(message)}$"):
        from_columns({name: np.array(values) for name, values in columns.items()})


def test_a_channel_that_was_not_recorded_is_nan() -> None:
    """Channels and notes are added to a copy."""
    found = from_columns(table([0.0, 1.0]))
    assert np.isnan(found.channel("absent")).all()
    assert found.channel("absent").shape == (2, 2)
    more = found.with_channels(value=found.channels["value"] + 1, new=found.channels["value"]).with_notes("a", "b")
    assert more.channels["value"][0, 0] == 2.0
    assert set(more.channels) == {"value", "new"}
    assert more.with_notes("c").notes == ("a", "b", "c")
    assert found.notes == ()


def test_parquet_and_csv_have_numbers_and_skip_texts(tmp_path: Path) -> None:
    """Integers, decimals and empty columns are numbers; text is left out, and refused as a time."""
    columns = {
        "t_s": pa.array([0, 1, 2]),
        "wheel": pa.array([1, 1, 1], pa.int8()),
        "value": pa.array(["1.5", "2.5", None]).cast(pa.decimal128(5, 2)),
        "half": pa.array([1.5, None, 2.5], pa.float32()),
        "nothing": pa.nulls(3),
        "remark": pa.array(["a", "b", "c"]),
    }
    pyarrow.parquet.write_table(pa.table(columns), tmp_path / "drive.parquet")
    found = read_recording(tmp_path / "drive.parquet")
    assert set(found.channels) == {"value", "half", "nothing"}
    np.testing.assert_array_equal(found.channels["value"][:, 0], [1.5, 2.5, np.nan])
    np.testing.assert_array_equal(found.channels["half"][:, 0], [1.5, np.nan, 2.5])
    (tmp_path / "drive.csv").write_text("t_s,axis,value\n0,1,3\n1,1,4\n")
    assert read_recording(tmp_path / "drive.csv", unit="axis").channels["value"][:, 0].tolist() == [3.0, 4.0]
    (tmp_path / "bad.csv").write_text("t_s,wheel,value\nnoon,1,3\n1,1,4\n")
    with pytest.raises(RecordingError, match="line 2, column t_s: 'noon' is not a number"):
        read_recording(tmp_path / "bad.csv")
    reasons = {"bad.parquet": "is not a whole Parquet file", "none.csv": "is not there"}
    for name, what in reasons.items():
        if name.endswith("parquet"):
            (tmp_path / name).write_bytes(b"nothing")
        with pytest.raises(RecordingError, match=what):
            read_recording(tmp_path / name)


@pytest.mark.parametrize(("code", "blank"), [(1e30, True), (-1e20, True), (9.97e36, True), (1e14, False)])
def test_a_code_for_not_measured_is_blank(code: float, blank: bool) -> None:
    """Fill values of other formats are counted in a note, and never compared."""
    rows = table([0.0, 1.0, 2.0])
    rows["value"][3] = code
    found = from_columns(rows)
    assert np.isnan(found.channels["value"][1, 1]) == blank
    assert any("beyond 1e+15" in note for note in found.notes) == blank
