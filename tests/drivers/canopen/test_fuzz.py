"""Random frames with every node's identifiers into a running network: no exception, and every reason is counted."""

from __future__ import annotations

import random

import pytest
from rig import rig, until

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.virtual.rover import KAPVIK

BASES = (0x000, 0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700)


def random_frame(chance: random.Random) -> Frame:
    """Return a frame that could come from a node, or from anywhere, with any data. Never a command to a node."""
    can_id = (
        chance.choice(BASES[1:]) + chance.choice(KAPVIK).node_id if chance.random() < 0.9 else chance.getrandbits(29)
    )
    extended = can_id > 0x7FF or chance.random() < 0.02
    remote = chance.random() < 0.02
    return Frame(0, can_id, chance.randbytes(0 if remote else chance.randint(0, 8)), extended=extended, remote=remote)


@pytest.mark.parametrize("seed", range(3))
async def test_random_frames_do_not_harm_the_network(seed: int) -> None:
    """During boot and operation 3000 random frames are sent, and the network continues and settles again."""
    chance = random.Random(seed)
    async with rig(sync_rate_Hz=50.0) as r, open_bus("virtual", r.bus.channel) as babbler:
        for _ in range(3):
            for _ in range(1000):
                await babbler.send(random_frame(chance))
            await r.network.settled()
        assert not r.running.done()
        await until(
            lambda: all(status.phase == "operational" for status in r.network.status.values()), "all operational again"
        )
        before = len(r.signals)
        await until(lambda: len(r.signals) > before + 100, "measurements go on")
        assert {"unknown-cob-id", "wrong-length", "unknown-state", "extended", "remote"} <= set(r.decoder.undecodable)
        ours = sum(frame.sent for frame in r.frames)
        assert r.bus.counters.echoed == ours
        assert r.bus.counters.received == len(r.frames) - ours
