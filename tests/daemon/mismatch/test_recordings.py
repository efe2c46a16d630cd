"""Recordings of the daemon as recordings of a comparison: what is read, and one message for what cannot be."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
import pytest
from estimates import estimate

from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.daemon.mismatch import recordings
from regolithd.daemon.mismatch.recordings import read_one
from regolithd.daemon.recording.mcap_file import DamagedRecordingError

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Return a recording's path; its content is what a test puts in its place."""
    path = tmp_path / "drive.mcap"
    path.touch()
    return path


def holding(monkeypatch: pytest.MonkeyPatch, snapshots: list[Any]) -> None:
    """Let each recording hold these snapshots."""
    monkeypatch.setattr(recordings, "recorded_snapshots", lambda _: iter(snapshots))


def test_snapshots_are_rows_of_six_wheels(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In their order, with the quantities in SI units."""
    first = estimate().snapshot
    snapshots = [replace(first, sequence=n, time_ns=first.time_ns + n * 500_000_000) for n in range(5)]
    holding(monkeypatch, snapshots)
    read = read_one(file, "wheel")
    assert read.wheels == (1, 2, 3, 4, 5, 6)
    np.testing.assert_allclose(np.diff(read.time_s), 0.5)
    np.testing.assert_allclose(read.channels["load_N"], np.tile(first.load_N, (5, 1)))


def test_a_recording_without_snapshots_is_one_message(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was closed at once, or is of another program."""
    holding(monkeypatch, [])
    with pytest.raises(RecordingError, match=r"drive\.mcap has no snapshots: it was closed at once"):
        read_one(file, "wheel")


def test_damage_and_content_of_others_are_one_message(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Damage with the command that reads what can be read; others' content with what is wrong in it."""
    holding(monkeypatch, [object()])
    with pytest.raises(RecordingError, match=r"drive\.mcap is no recording of `regolithd run` \(AttributeError: "):
        read_one(file, "wheel")

    def damaged(_: object) -> NoReturn:
        raise DamagedRecordingError("drive.mcap: a chunk is damaged.")

    monkeypatch.setattr(recordings, "recorded_snapshots", damaged)
    with pytest.raises(RecordingError, match=r"a chunk is damaged\. `regolithd export` writes what can be read"):
        read_one(file, "wheel")


@pytest.mark.parametrize(("name", "told"), [("absent.mcap", "is not there"), ("folder.mcap", "is not a file")])
def test_what_is_no_file_is_one_message(name: str, told: str, tmp_path: Path) -> None:
    """With its path."""
    (tmp_path / "folder.mcap").mkdir()
    with pytest.raises(RecordingError, match=f"{name} {told}"):
        read_one(tmp_path / name, "wheel")
