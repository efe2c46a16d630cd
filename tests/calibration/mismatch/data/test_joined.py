"""Several recordings put together keep their runs, and lack nothing that one of them has."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.data.joined import joined
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.errors import RecordingError


def test_each_recording_is_a_run_of_its_own() -> None:
    """Instants follow each other, run numbers count on, and the names are in the notes."""
    one = from_columns({"t_s": [0.0, 1, 2, 3], "run": [5.0, 5, 7, 7], "y": [1.0, 2, 3, 4]})
    two = from_columns({"t_s": [10.0, 11], "y": [5.0, 6]})
    found = joined([one, two], ["a.csv", "b.csv"])
    np.testing.assert_array_equal(found.run, [1, 1, 2, 2, 3, 3])
    np.testing.assert_array_equal(found.time_s, [0, 1, 0, 1, 0, 1])
    np.testing.assert_array_equal(found.channels["y"][:, 0], [1, 2, 3, 4, 5, 6])
    assert found.notes[:2] == ("a.csv: runs 1 to 2.", "b.csv: run 3.")


def test_a_first_run_of_a_single_instant_is_counted() -> None:
    """As is every other."""
    one = from_columns({"t_s": [0.0, 1, 2], "run": [5.0, 7, 7], "y": [1.0, 2, 3]})
    two = from_columns({"t_s": [10.0, 11], "y": [5.0, 6]})
    assert joined([one, two], ["a.csv", "b.csv"]).notes[0] == "a.csv: runs 1 to 2."


def test_what_one_recording_lacks_is_not_measured_there() -> None:
    """Wheels and channels are those of all recordings."""
    one = from_columns({"t_s": [0.0, 1], "wheel": [1.0, 1], "y": [1.0, 2]})
    two = from_columns({"t_s": [0.0, 1], "wheel": [2.0, 2], "y": [3.0, 4], "temperature": [5.0, 6]})
    found = joined([one, two], ["a", "b"])
    assert found.wheels == (1, 2)
    np.testing.assert_array_equal(found.channels["y"], [[1, np.nan], [2, np.nan], [np.nan, 3], [np.nan, 4]])
    np.testing.assert_array_equal(found.channels["temperature"][:, 1], [np.nan, np.nan, 5, 6])
    assert "a: temperature was not recorded." in found.notes


def test_one_recording_stays_as_it_is() -> None:
    """Nothing is said about a single file."""
    one = from_columns({"t_s": [0.0, 1], "y": [1.0, 2]})
    assert joined([one], ["a"]) is one


def test_recordings_of_two_machines_are_refused() -> None:
    """Without a common column there is nothing to compare together."""
    recordings = [from_columns({"t_s": [0.0, 1], name: [1.0, 2]}) for name in "xy"]
    with pytest.raises(RecordingError, match="no column is in all of a, b"):
        joined(recordings, ["a", "b"])


def test_a_channel_that_is_constant_in_each_recording_but_not_in_all_has_no_note() -> None:
    """What depends on it shows; one that is constant in all of them is told of each."""
    one = from_columns({"t_s": [0.0, 1, 2], "start_K": [290.0, 290, 290], "head_m": [7.0, 7, 7], "y": [1.0, 2, 3]})
    two = from_columns({"t_s": [0.0, 1, 2], "start_K": [310.0, 310, 310], "head_m": [7.0, 7, 7], "y": [1.0, 2, 3]})
    notes = joined([one, two], ["a.csv", "b.csv"]).notes
    assert not any("start_K" in note for note in notes)
    assert [note.split(":")[0] for note in notes if "head_m is constant" in note] == ["a.csv", "b.csv"]
