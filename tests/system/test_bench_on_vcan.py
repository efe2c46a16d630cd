"""`regolithd bench` and `regolithd bench-fault` as separate processes on a SocketCAN link."""

from __future__ import annotations

import asyncio
import json
import signal
import sys
import time
from typing import TYPE_CHECKING

import pytest

from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.master.events import NodeBooted, NodeLost
from regolithd.drivers.master.network import Network, NetworkSettings, NodePhase
from regolithd.drivers.virtual import KAPVIK

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from regolithd.drivers.master.events import NetworkEvent

CHANNEL = "vcan1"


async def regolithd(*arguments: str) -> asyncio.subprocess.Process:
    """Start a sub-command."""
    return await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "regolithd", *arguments),
        stdout=asyncio.subprocess.PIPE,
    )


async def until(condition: Callable[[], object], what: str) -> None:
    """Wait until a condition holds, at most 90 s."""
    end = time.monotonic() + 90
    while not condition():
        assert time.monotonic() < end, f"not within 90 s: {what}"
        await asyncio.sleep(0.05)


@pytest.mark.vcan
async def test_a_node_is_switched_off_and_on_by_bench_fault(tmp_path: Path) -> None:
    """A node is booted, lost and booted again, and at its end the bench prints each node's counters."""
    control = ["--control", str(tmp_path / "bench.sock")]
    bench = await regolithd("bench", "--channel", CHANNEL, *control)
    assert bench.stdout is not None
    async with asyncio.timeout(60):
        assert (await bench.stdout.readline()).startswith(b"ready: 14 nodes on socketcan vcan1")
    events: list[NetworkEvent] = []
    try:
        async with open_bus("socketcan", CHANNEL) as bus:
            network = Network(bus, NetworkSettings(KAPVIK, sync_rate_Hz=5.0), on_event=events.append)
            running = asyncio.ensure_future(network.run())
            await until(
                lambda: {s.phase for s in network.status.values()} == {NodePhase.OPERATIONAL}, "all operational"
            )
            for fault, event in (("off", NodeLost), ("on", NodeBooted)):
                events.clear()
                injection = await regolithd("bench-fault", *control, fault, "3")
                assert (await injection.communicate())[0] == b"ok\n"
                await until(lambda event=event: [e for e in events if isinstance(e, event) and e.node_id == 3], fault)
            running.cancel()
            await asyncio.wait([running])
        bench.send_signal(signal.SIGTERM)
        async with asyncio.timeout(60):
            output, _ = await bench.communicate()
        assert bench.returncode == 0
    finally:
        if bench.returncode is None:
            bench.kill()
            await bench.wait()
    counts = json.loads(output.splitlines()[-1])
    assert counts["3"]["boot_up"] > counts["2"]["boot_up"]
    assert counts["bus"]["sync"] == network.counters.sync.produced
