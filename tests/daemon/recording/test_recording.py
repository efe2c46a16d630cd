"""A recording reads back equal to the last bit, complete or truncated."""

import json
import math
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regolithd.daemon.config.configuration import Configuration, Recording
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.recording.candump import frame_line, parse_line, read_log
from regolithd.daemon.recording.content import ESTIMATE, SNAPSHOT, six, snapshot_from_json
from regolithd.daemon.recording.digest import Digest, _flattened
from regolithd.daemon.recording.mcap_file import McapFile, read_messages, read_metadata
from regolithd.daemon.recording.recorder import Recorder
from regolithd.daemon.recording.replay import replay_logs
from regolithd.daemon.recording.ring import next_stem, oldest_first
from regolithd.drivers.can.frame import Frame

FRAMES = st.builds(
    Frame,
    time_ns=st.integers(0, 4_000_000_000_000_000).map(lambda us: us * 1000),
    can_id=st.integers(0, 0x7FF),
    data=st.binary(max_size=8),
    extended=st.just(False),
    remote=st.just(False),
    error=st.just(False),
    sent=st.booleans(),
)


@given(FRAMES)
def test_a_frame_survives_its_line(frame: Frame) -> None:
    """A frame that is written as a line of the log reads back equal."""
    assert parse_line(frame_line(frame, "can0")) == frame


@pytest.mark.parametrize(
    "frame",
    [
        Frame(1_000_000, 0x12345678, b"\x01", extended=True),
        Frame(1_000_000, 0x181, b"", remote=True),
        Frame(1_000_000, 0x4, bytes(8), error=True),
    ],
)
def test_extended_remote_and_error_frames_survive_too(frame: Frame) -> None:
    """They are written as can-utils write them, and read back equal."""
    assert parse_line(frame_line(frame, "can0")) == frame


def test_an_invalid_line_is_no_frame() -> None:
    """An incomplete line, and one in another format, is not a frame."""
    whole = frame_line(Frame(1_000_000, 0x181, b"\x01\x02"), "can0")
    assert all(parse_line(whole[:cut]) is None for cut in range(len(whole)))
    assert parse_line("(1.5) can0 181#00\n") is None


@pytest.mark.skipif(shutil.which("log2asc") is None, reason="can-utils are not installed: apt-get install can-utils")
def test_can_utils_read_the_log(tmp_path: Path, drive: Callable) -> None:
    """`log2asc` shows every frame with its time."""
    frames = list(drive().frames(20))
    log = tmp_path / "can.log"
    log.write_text("".join(frame_line(frame, "can0") for frame in frames))
    shown = subprocess.run(["log2asc", "-I", log, "can0"], capture_output=True, text=True, check=True).stdout
    lines = [line.split() for line in shown.splitlines() if "d " in line and line.lstrip()[0].isdigit()]
    assert len(lines) == len(frames)
    first = frames[0].time_ns // 1000
    assert [round(float(line[0]) * 1e6) for line in lines] == [frame.time_ns // 1000 - first for frame in frames]


def recorded(folder: Path, frames: list[Frame], configuration: Configuration) -> tuple[Path, Path, Digest]:
    """Record frames as the daemon does; return both files and the digest of what was estimated."""
    recorder = Recorder(Recording(directory=folder), "can0", {"configuration": configuration.model_dump_json()})
    paths = recorder.paths
    assert paths is not None
    chain, digest = Chain(configuration, load_models(configuration)), Digest()
    for start in range(0, len(frames), 64):
        batch = frames[start : start + 64]
        recorder.frames(batch)
        for estimate in chain.feed(batch):
            digest.add(estimate)
            recorder.estimate(estimate)
        recorder.flush()
    recorder.close()
    return *paths, digest


def test_a_replayed_log_gives_the_same_numbers_to_the_last_bit(
    tmp_path: Path, drive: Callable, configuration: Configuration
) -> None:
    """The digest of a replay equals that of the live run."""
    _, log, live = recorded(tmp_path, list(drive(nodes_silent=frozenset({3})).frames(50)), configuration)
    chain, replayed = Chain(configuration, load_models(configuration)), Digest()
    for estimate in chain.feed(read_log(log)):
        replayed.add(estimate)
    assert live.count == replayed.count == 50
    assert str(live) == str(replayed)


def test_the_digest_sees_a_change_of_one_bit(drive: Callable, configuration: Configuration) -> None:
    """Other noise gives another digest, the same noise the same."""
    models = load_models(configuration)
    digests = []
    for seed in (1, 1, 2):
        digest = Digest()
        for estimate in Chain(configuration, models).feed(drive(seed=seed).frames(5)):
            digest.add(estimate)
        digests.append(str(digest))
    assert digests[0] == digests[1] != digests[2]


def test_snapshots_read_back_to_the_last_bit(tmp_path: Path, drive: Callable, configuration: Configuration) -> None:
    """JSON keeps every digit, and null reads back as NaN."""
    frames = list(drive(nodes_silent=frozenset({2})).frames(10))
    mcap, _, _ = recorded(tmp_path, frames, configuration)
    chain = Chain(configuration, load_models(configuration))
    expected = [estimate.snapshot.values for estimate in chain.feed(frames)]
    found = [snapshot_from_json(each.content).values for each in read_messages(mcap) if each.topic == SNAPSHOT]
    np.testing.assert_array_equal(np.stack(found), np.stack(expected))
    assert Configuration.model_validate_json(read_metadata(mcap)["configuration"]) == configuration


def test_a_file_cut_off_anywhere_reads_as_far_as_it_goes(
    tmp_path: Path, drive: Callable, configuration: Configuration
) -> None:
    """Every message before the last flush is read, and nothing raises, wherever the file ends."""
    mcap, _, _ = recorded(tmp_path, list(drive(rate_Hz=100).frames(60)), configuration)
    whole = mcap.read_bytes()
    cut_file = tmp_path / "cut.mcap"
    counts = []
    for cut in np.linspace(0, len(whole), 200).astype(int):
        cut_file.write_bytes(whole[:cut])
        counts.append(sum(message.topic == ESTIMATE for message in read_messages(cut_file)))
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[-1] == 60
    assert len(set(counts)) > 5  # many small chunks, not one


def test_the_oldest_files_go_when_the_limit_is_reached(tmp_path: Path, drive: Callable) -> None:
    """Files of other programs are kept."""
    foreign = tmp_path / "notes.log"
    foreign.write_text("mine")
    clock = iter(range(10**18, 2 * 10**18, 60 * 10**9))
    settings = Recording(directory=tmp_path, limit_MB=1, file_minutes=0.1)
    recorder = Recorder(settings, "can0", {}, monotonic_ns=lambda: next(clock))
    frames = list(drive(rate_Hz=100).frames(300))
    for _ in range(12):
        recorder.frames(frames)
        recorder.flush()
    recorder.close()
    kept = sorted(tmp_path.glob("rover-*.log"))
    size = sum(path.stat().st_size for path in tmp_path.glob("rover-*"))
    assert 2 <= len(kept) < 12
    assert size < 1_000_000 + 2 * kept[0].stat().st_size
    assert foreign.read_text() == "mine"


def test_a_disk_that_others_fill_costs_old_recordings_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, drive: Callable
) -> None:
    """Below the limit, the oldest files are deleted while the disk has less than the reserve."""
    frames = list(drive().frames(5))

    def record(hour: int) -> None:
        recorder = Recorder(Recording(directory=tmp_path), "can0", {}, now_ns=lambda: 10**18 + hour * 3600 * 10**9)
        recorder.frames(frames)
        recorder.close()

    for hour in range(3):
        record(hour)
    before = sorted(tmp_path.glob("rover-*"), key=lambda path: (path.stat().st_mtime_ns, path.name))
    assert len(before) == 6
    monkeypatch.setattr(
        "regolithd.daemon.recording.ring.shutil.disk_usage",
        lambda folder: shutil._ntuple_diskusage(0, 0, 10**9 if len(list(folder.glob("rover-*"))) <= 4 else 0),
    )
    record(3)
    assert not before[0].exists()
    assert not before[1].exists()
    assert all(path.exists() for path in before[2:])


def test_a_disk_that_fails_stops_the_recording_and_nothing_else(tmp_path: Path, drive: Callable) -> None:
    """`problem` has the reason, and recording begins again when the disk works."""
    now = 5 * 10**9
    place = tmp_path / "recordings"
    place.write_text("a file where a folder should be")
    recorder = Recorder(Recording(directory=place), "can0", {}, monotonic_ns=lambda: now)
    assert recorder.problem is not None
    assert str(place) in recorder.problem
    recorder.frames(list(drive().frames(1)))
    assert recorder.lost == 16
    place.unlink()
    recorder.flush()
    assert recorder.paths is None
    now += 11 * 10**9
    recorder.flush()
    assert recorder.paths is not None
    assert recorder.problem is None
    recorder.close()


def test_a_clock_that_is_set_back_pauses_nothing(tmp_path: Path) -> None:
    """After an error of the disk, recording begins again after the same pause; a file does not become longer."""
    wall, running = 10**18, 0
    place = tmp_path / "recordings"
    place.write_text("a file where a folder should be")
    settings = Recording(directory=place, file_minutes=1)
    recorder = Recorder(settings, "can0", {}, now_ns=lambda: wall, monotonic_ns=lambda: running)
    place.unlink()
    wall -= 3600 * 10**9
    running += 11 * 10**9
    recorder.flush()
    first = recorder.paths
    assert first is not None
    wall -= 3600 * 10**9
    running += 61 * 10**9
    recorder.flush()
    assert recorder.paths not in {first, None}
    recorder.close()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(-7200, 7200), min_size=1, max_size=8))
def test_the_oldest_files_go_first_whatever_the_clock_says(
    tmp_path_factory: pytest.TempPathFactory, hours: list[int]
) -> None:
    """The newest recordings stay, files of version 0.1 go first, and no name is used twice."""
    folder = tmp_path_factory.mktemp("recordings")
    old = folder / "rover-20300101T000000Z.log"
    old.touch()
    written = [old]
    for offset_s in hours:
        now_ns = 10**18 + offset_s * 10**9
        recorder = Recorder(Recording(directory=folder), "can0", {}, now_ns=lambda now_ns=now_ns: now_ns)
        assert recorder.paths is not None
        recorder.close()
        mcap, log = recorder_paths(folder, written)
        os.utime(mcap, ns=(now_ns, now_ns))
        os.utime(log, ns=(now_ns, now_ns))
        written += [log, mcap]
    assert oldest_first(folder) == written


def recorder_paths(folder: Path, known: list[Path]) -> list[Path]:
    """Return the two new files of a folder, the MCAP file first."""
    return sorted(set(folder.glob("rover-*")) - set(known), key=lambda path: path.suffix, reverse=True)


def test_numbers_that_are_not_are_null(drive: Callable, configuration: Configuration, tmp_path: Path) -> None:
    """No message of the file contains NaN."""
    mcap, _, _ = recorded(tmp_path, list(drive(nodes_silent=frozenset({5})).frames(3)), configuration)
    for message in read_messages(mcap):
        assert not any(
            isinstance(value, float) and math.isnan(value)
            for row in message.content.values()
            if isinstance(row, list)
            for value in row
        )


def as_lists(content: dict[str, Any]) -> dict[str, Any]:
    """Return a snapshot or estimate with a list of six, and null, as version 0.1 wrote them."""
    names = {match[1] for name in content if (match := re.fullmatch(r"(.+)_[1-6]", name))}
    lists: dict[str, Any] = {name: [content.get(each) for each in six(name)] for name in names}
    if outside := lists.pop("outside_training_range", None):
        lists["outside"] = [text.split(", ") if text else [] for text in outside]
    return {name: value for name, value in content.items() if name[:-2] not in names} | lists


def test_a_recording_of_version_0_1_is_compared_under_todays_names(
    tmp_path: Path, drive: Callable, configuration: Configuration
) -> None:
    """Its lists of six and its `belief` are compared under today's names; a difference in the last bit is found."""
    calibrated = {"no_load_current_A": 0.037, "no_load_current_std_A": 0.001, "gain_relative_std": 0.03}
    configuration = Configuration.model_validate(configuration.model_dump() | {"drivetrain": calibrated})
    mcap, log, digest = recorded(tmp_path, list(drive(rate_Hz=2.0).frames(20)), configuration)
    messages = list(read_messages(mcap))
    models = load_models(configuration)
    for factor in (1.0, 1.0 + 2**-52):
        old = McapFile(mcap.open("wb"), {})
        posteriors = 0
        for message in messages:
            content = as_lists(message.content)
            if posterior := content.pop("posterior", None):
                posteriors += 1
                interval = posterior["cohesion_Pa"] | {"mean": factor * posterior["cohesion_Pa"]["mean"]}
                content["belief"] = posterior | {"cohesion_Pa": interval}
            old.write(message.topic, message.time_ns, json.dumps(content).encode())
        old.close()
        result = replay_logs([log], configuration, models)
        assert posteriors > 10
        assert result.compared == 2 * digest.count == 40
        assert len(result.different) == (0 if factor == 1.0 else posteriors)
        assert str(result.digest) == str(digest)


@pytest.mark.parametrize(
    ("one", "other"), [(1.0, 1), ("1", 1), (None, ""), (0.0, -0.0), (("a", "b"), ("ab", "")), (1.0, 1.0 + 2**-52)]
)
def test_the_digest_differs_for_values_that_differ_in_type_sign_or_last_bit(one: object, other: object) -> None:
    """Equal digests mean equal values."""
    assert b"".join(_flattened((one,))) == b"".join(_flattened((one,)))
    assert b"".join(_flattened((one,))) != b"".join(_flattened((other,)))


def test_the_digest_refuses_a_value_that_it_cannot_encode() -> None:
    """A field of an unknown type is not left out silently."""
    with pytest.raises(TypeError, match="no encoding"):
        list(_flattened(([1.0],)))


def test_a_recording_is_named_after_the_second_it_began_in(tmp_path: Path) -> None:
    """Cut off, not rounded, and numbered after the highest number that is there."""
    assert next_stem(tmp_path, 1_370_959_642_999_999_999).name == "rover-20130611T140722Z-000001"
    for name in ("rover-20130611T140722Z-000041.mcap", "rover-20200101T000000Z-000007.log", "rover-old.mcap"):
        (tmp_path / name).touch()
    assert next_stem(tmp_path, 1_370_959_642_000_000_000).name == "rover-20130611T140722Z-000042"
