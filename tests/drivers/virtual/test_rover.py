"""The virtual rover's schedule."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from virtual_master import LOAD_CELL_TPDO, Master

from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.virtual import Bench, VirtualRover

if TYPE_CHECKING:
    from regolithd.drivers.can.frame import Frame


def test_a_delayed_frame_is_the_next_thing_due() -> None:
    """`due` returns the time of a frame that waits, so that it is sent neither late nor by polling."""
    master = Master()
    master.configure(11, tpdo=LOAD_CELL_TPDO)
    master.nmt(1)
    master.rover.inject_fault("slow 11 30")
    assert master.sync() == {}
    assert master.rover.due() == master.now + 30_000_000
    assert master.rover.outgoing(master.now + 29_999_999) == []
    assert [frame.can_id for frame in master.rover.outgoing(master.now + 30_000_000)] == [0x18B]
    assert master.rover.due() > master.now + 30_000_000


async def test_it_waits_until_something_is_due() -> None:
    """On a silent bus it looks for frames twice for each thing that is due, and does not poll."""
    async with open_bus("virtual", "waiting-rover") as bus:
        receive, looked = bus.receive, []

        async def counted() -> list[Frame]:
            looked.append(1)
            return await receive()

        bus.receive = counted  # type: ignore[method-assign]
        serving = asyncio.create_task(VirtualRover(Bench()).run(bus))
        await asyncio.sleep(0.3)
        serving.cancel()
        await asyncio.wait([serving])
    assert 0 < len(looked) < 60
