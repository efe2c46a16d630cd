"""The measurements of `make bench`, short: that they measure something, and within what no machine should exceed."""

from __future__ import annotations

import pytest
import speed
import speed_peers
from broker import mosquitto_program


@pytest.mark.timeout(180)
async def test_a_daemon_on_a_pair_of_sockets_is_measured() -> None:
    """It boots all nodes, produces SYNCs, delivers snapshots, and uses a part of one core and of the memory."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    found, rig = await speed.measure(5.0, 3.0)
    assert int(found["syncs"] or 0) >= 5
    assert 0.0 < float(found["core_percent"] or 0) < 60.0
    assert 30.0 < float(found["memory_MB"] or 0) < 200.0
    assert len(rig.delays_ms) >= 5
    assert min(rig.delays_ms) > 0.0


async def test_both_readers_are_timed_on_the_same_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Decoding and bursts cost less than with python-can and canopen, on any machine."""
    monkeypatch.setattr(speed_peers, "ROUNDS", 3)
    found = await speed_peers.frame_times()
    assert float(found["a frame, decode / times"] or 0) > 1.5
    assert float(found["a frame, burst / times"] or 0) > 1.5


def test_a_killed_process_has_lost_no_stored_message() -> None:
    """Its processor time is that of the appending process."""
    found = speed_peers.store_cost()
    assert found["a stored message, 2 kB / lost by SIGKILL, of 400"] == 0
    assert 0.0 < float(found["a stored message, 2 kB / regolithd's store: CPU, µs"] or 0) < 1000.0
