"""Where the disk is short, whole recordings go, the oldest first, no more than is needed, and the alarm says so."""

from __future__ import annotations

import errno
import shutil
from typing import TYPE_CHECKING

from regolithd.daemon.config.configuration import Recording
from regolithd.daemon.recording.candump import read_log
from regolithd.daemon.recording.recorder import RETRY_S, Recorder, _Pair
from regolithd.daemon.recording.ring import make_room, oldest_first

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pytest

DISK = "regolithd.daemon.recording.ring.shutil.disk_usage"


def usage(free: int) -> shutil._ntuple_diskusage:
    """Return what `shutil.disk_usage` does."""
    return shutil._ntuple_diskusage(0, 0, free)


def test_a_recording_goes_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the log's room would do, its MCAP file goes as well: it could not be replayed."""
    for number in range(3):
        for suffix in (".log", ".mcap"):
            (tmp_path / f"rover-20260101T000000Z-{number:06d}{suffix}").write_bytes(b"x" * 1000)
    files = oldest_first(tmp_path)
    monkeypatch.setattr(DISK, lambda _: usage(200 if len(oldest_first(tmp_path)) == 6 else 500))
    room = make_room(tmp_path, 1.0)
    assert oldest_first(tmp_path) == files[2:]
    assert (room.size, room.deleted_early) == (6200, True)


def test_nothing_goes_while_the_disk_has_a_twentieth_of_what_recordings_can_take(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise a disk that is much smaller than the limit would cost all, and still be smaller."""
    for name in ("rover-a.log", "rover-a.mcap"):
        (tmp_path / name).write_bytes(b"x" * 1000)
    monkeypatch.setattr(DISK, lambda _: usage(106))
    assert make_room(tmp_path, 4000.0).deleted_early is False
    assert len(oldest_first(tmp_path)) == 2
    monkeypatch.setattr(DISK, lambda _: usage(104))
    make_room(tmp_path, 4000.0, stays=tmp_path / "rover-a.log")
    assert len(oldest_first(tmp_path)) == 2
    make_room(tmp_path, 4000.0)
    assert oldest_first(tmp_path) == []


def test_on_a_disk_smaller_than_the_limit_the_newest_stays_without_a_pause(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, drive: Callable
) -> None:
    """A pair takes a tenth of the disk at most, so that the oldest tenth goes, and no frame of the rest is missing."""
    capacity = 600_000

    def disk(folder: Path) -> shutil._ntuple_diskusage:
        return usage(capacity - sum(path.stat().st_size for path in folder.iterdir()))

    monkeypatch.setattr(DISK, disk)
    recorder = Recorder(Recording(directory=tmp_path, limit_MB=1), "can0", {})
    frames = list(drive(rate_Hz=100).frames(1800))
    assert not recorder.deletes_early
    for start in range(0, len(frames), 160):
        recorder.frames(frames[start : start + 160])
        recorder.flush()
        assert recorder.problem is None
        assert disk(tmp_path).free > 0
    recorder.close()
    assert (recorder.lost, recorder.deletes_early) == (0, True)
    logs = [path for path in oldest_first(tmp_path) if path.suffix == ".log"]
    assert [path.with_suffix(".mcap").exists() for path in logs] == [True] * len(logs)
    kept = [(frame.can_id, frame.data) for log in logs for frame in read_log(log)]
    assert kept == [(frame.can_id, frame.data) for frame in frames[-len(kept) :]]
    assert sum(path.stat().st_size for path in logs) > 0.75 * capacity


def test_files_that_are_moved_while_they_are_written_stop_nothing(tmp_path: Path, drive: Callable) -> None:
    """The recording goes on where it is until the next pair is due."""
    recorder = Recorder(Recording(directory=tmp_path / "recordings"), "can0", {})
    frames = list(drive().frames(3))
    for path in recorder.paths or ():
        path.rename(tmp_path / path.name)
    recorder.frames(frames)
    recorder.flush()
    assert recorder.problem is None
    recorder.close()
    (log,) = tmp_path.glob("*.log")
    assert len(list(read_log(log))) == len(frames)


def test_a_full_disk_leaves_no_empty_files_and_the_problem_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file begins on a full disk, and cannot be written: it would be one more with each attempt."""
    now = 0

    def full(_pair: _Pair) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(_Pair, "flush", full)
        recorder = Recorder(Recording(directory=tmp_path), "can0", {}, monotonic_ns=lambda: now)
        for _ in range(5):
            now += int((RETRY_S + 1) * 1e9)
            recorder.flush()
            assert recorder.problem == f"{tmp_path}: the disk is full"
            assert recorder.remedy == "Free space on the disk, or lower [recording] limit_MB."
            assert oldest_first(tmp_path) == []
    now += int((RETRY_S + 1) * 1e9)
    recorder.flush()
    assert recorder.problem is None
    assert len(oldest_first(tmp_path)) == 2
    recorder.close()
