"""The measurements of `make bench`, short: that they measure something, and within what no machine should exceed."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest
import speed
import speed_candump
import speed_peers
import speed_queue
from broker import mosquitto_program
from speed_table import Row, flat

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.timeout(180)
async def test_a_daemon_on_a_pair_of_sockets_is_measured() -> None:
    """It boots all nodes, produces SYNCs, delivers snapshots, and uses a part of one core and of the memory."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    found, rig = await speed.measure(5.0, 3.0)
    assert found.syncs >= 5
    assert 0.0 < found.core_percent < 60.0
    assert 30.0 < found.memory_MB < 200.0
    assert len(rig.delays_ms) >= 5
    assert min(rig.delays_ms) > 0.0


async def test_both_readers_are_timed_on_the_same_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Decoding and bursts cost less than with python-can and canopen, on any machine."""
    monkeypatch.setattr(speed_peers, "ROUNDS", 3)
    rows = {row.figure: row for row in await speed_peers.frame_times()}
    for name in ("decode", "burst"):
        row = rows[f"a frame, {name}: CPU, µs"]
        assert row.theirs is not None
        assert row.ours is not None
        assert row.theirs > 1.5 * row.ours > 0.0


async def test_a_killed_process_has_lost_no_stored_message() -> None:
    """All are delivered after it; mosquitto as it is by default has stored none, saved at each change nearly all."""
    if not speed_queue.available():
        pytest.skip(speed_queue.REMEDY)
    ours = await speed_queue.ours()
    assert ours.lost == 0
    assert 0.0 < ours.cpu_us < 1000.0
    assert ours.delivered_per_s is not None
    default = await speed_queue.mosquittos("")
    assert (default.lost, default.delivered_per_s) == (speed_queue.MESSAGES, None)
    assert (await speed_queue.mosquittos(speed_queue.EVERY_CHANGE)).lost < speed_queue.MESSAGES / 2


def test_a_peer_that_is_not_here_is_skipped_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    """One line says how to get it; the figures that need no peer are there."""
    monkeypatch.setattr(speed_peers.shutil, "which", lambda _: None)
    (row,) = speed_peers.candump(1.0)
    assert "apt-get install can-utils" in row.peer
    assert flat([row, Row("a", 1.0, "2"), Row("b", 2.0, theirs=3.0, peer="c")]) == {
        "logging of a saturated bus: CPU per frame, µs / the peer is": row.peer,
        "a / regolithd": 1.0,
        "a / goal": "2",
        "b / regolithd": 2.0,
        "b / peer": 3.0,
        "b / the peer is": "c",
    }


@pytest.mark.vcan
def test_our_reader_loses_no_frame_of_a_saturated_bus(tmp_path: Path) -> None:
    """Beside candump, which logs the same frames."""
    if shutil.which("candump") is None:
        pytest.skip("no candump here: apt-get install can-utils")
    found = speed_candump.compare(3.0, tmp_path)
    assert found["sent"] > 1000
    assert found["we_lost"] == 0
    assert found["they_lost"] < found["sent"]
    assert found["our_us"] > 0.0
