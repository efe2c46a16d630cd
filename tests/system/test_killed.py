"""SIGKILL at a random moment: the recording can be read and lacks at most the last second."""

import random
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from regolithd.daemon.recording.candump import read_log
from regolithd.daemon.recording.content import SNAPSHOT
from regolithd.daemon.recording.mcap_file import read_messages
from regolithd.daemon.recording.replay import ReplayError, replay_logs
from regolithd.daemon.setup import models_or_exit, recorded_configuration

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "tests" / "bench" / "recording_daemon.py"
TIMES = 20
RATE_HZ = 20.0
SECOND_NS = 1_000_000_000


def kill_one(folder: Path, moment_s: float) -> tuple[int, int]:
    """Kill a daemon `moment_s` after its first snapshot; return sequence and time [ns] of the last that it printed."""
    command = [sys.executable, str(SCRIPT), str(folder), str(RATE_HZ)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(moment_s)
        process.kill()
        lines = [first, *process.stdout.read().splitlines(keepends=True)]
    whole = [line for line in lines if line.endswith("\n")]
    sequence, time_ns = whole[-1].split()
    return int(sequence), int(time_ns)


@pytest.mark.timeout(400)
def test_a_killed_daemon_leaves_a_recording_that_lacks_at_most_the_last_second(tmp_path: Path) -> None:
    """After each of twenty kills the recording lacks at most 1 s, and its log replays to the same numbers."""
    moments = random.Random(5)
    folders = [tmp_path / str(number) for number in range(TIMES)]
    with ThreadPoolExecutor(2) as pool:
        last = list(pool.map(kill_one, folders, [moments.uniform(0.0, 3.0) for _ in folders]))
    for folder, (sequence, time_ns) in zip(folders, last, strict=True):
        (mcap,) = folder.glob("*.mcap")
        (log,) = folder.glob("*.log")
        snapshots = [message for message in read_messages(mcap) if message.topic == SNAPSHOT]
        recorded_until = max((message.time_ns for message in snapshots), default=time_ns - sequence * SECOND_NS // 20)
        assert time_ns - recorded_until <= SECOND_NS, f"{folder}: {sequence}"
        assert [message.content["sequence"] for message in snapshots] == list(range(len(snapshots)))
        frames = list(read_log(log))
        assert time_ns - frames[-1].time_ns <= SECOND_NS if frames else sequence < RATE_HZ
        configuration = recorded_configuration(mcap)
        if not frames:  # killed before anything was flushed: there is nothing to replay, and it says so
            with pytest.raises(ReplayError, match="it is empty"):
                replay_logs([log], configuration, models_or_exit(configuration))
            assert not snapshots
            continue
        replayed = replay_logs([log], configuration, models_or_exit(configuration))
        assert replayed.compared > 0 or not snapshots
        # The log may end before the MCAP file does: both are flushed, one after the other.
        assert all("was recorded, and is not in the log" in line for line in replayed.different)
