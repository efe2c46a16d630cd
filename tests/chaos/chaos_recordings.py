"""Checks the recordings of a run: readable without a gap, and replayed to the same numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.daemon.recording.mcap_file import read_messages
from regolithd.daemon.recording.replay import replay_logs
from regolithd.daemon.setup import models_or_exit, recorded_configuration

if TYPE_CHECKING:
    from pathlib import Path

    from chaos_rig import Rig


def check_recordings(rig: Rig) -> tuple[int, int]:
    """Return the number of readable MCAP files, and of messages in the first file of each run that replay alike."""
    paths = sorted((rig.disk / "recordings").glob("*.mcap"), key=lambda path: path.stem.split("-")[-1])
    compared = 0
    for path in paths:
        gaps: list[str] = []
        messages = sum(1 for _ in read_messages(path, on_gap=gaps.append))
        rig.check(not gaps, f"{path.name}: {gaps}")
        # A daemon may be killed after it deleted the oldest log, to make room, and before it deleted its MCAP file.
        if messages and path.with_suffix(".log").exists() and begins_a_run(path):
            compared += replays(rig, path)
    return len(paths), compared


def begins_a_run(path: Path) -> bool:
    """Return whether it holds the first snapshot of a run of the daemon: the state of filters is known there."""
    return any(message.content.get("sequence") == 0 for message in read_messages(path, on_gap=lambda _: None))


def replays(rig: Rig, path: Path) -> int:
    """Check that the log beside a recording gives the same numbers; return how many messages were compared."""
    configuration = recorded_configuration(path)
    result = replay_logs([path.with_suffix(".log")], configuration, models_or_exit(configuration))
    # A killed daemon's log may end before its MCAP file does.
    wrong = [line for line in result.different if "was recorded, but" not in line]
    rig.check(not wrong, f"{path.name} replays to other numbers: {wrong[:3]}")
    return result.compared
