"""The virtual rover's schedule."""

from __future__ import annotations

from virtual_master import LOAD_CELL_TPDO, Master


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
