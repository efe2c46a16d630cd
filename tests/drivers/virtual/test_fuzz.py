"""Arbitrary frames to the virtual nodes: no exception, and they work afterwards."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from virtual_master import MOTOR_RPDO, MOTOR_TPDO, Master

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.virtual import KAPVIK

NODES = (1, 11, 21, 22)
IDENTIFIERS = [0x000, 0x080, 0x77F, *(base + node for base in (0x200, 0x300, 0x600, 0x700) for node in NODES)]
FRAMES = st.lists(
    st.builds(
        Frame,
        time_ns=st.integers(0, 2**62),
        can_id=st.sampled_from(IDENTIFIERS) | st.integers(0, 0x7FF),
        data=st.binary(max_size=8),
        extended=st.just(value=False) | st.booleans(),
        remote=st.just(value=False) | st.booleans(),
        error=st.just(value=False) | st.booleans(),
        sent=st.just(value=False) | st.booleans(),
    ),
    max_size=40,
)


@settings(max_examples=150, deadline=None)
@given(FRAMES)
def test_arbitrary_frames_do_no_harm(frames: list[Frame]) -> None:
    """Every frame that a node sends is a valid CAN frame, and after a reset the nodes work as new."""
    master = Master([node for node in KAPVIK if node.node_id in NODES])
    master.configure(1, tpdo=MOTOR_TPDO, rpdo=MOTOR_RPDO)
    master.nmt(1)
    for frame in frames:
        master.rover.take(frame, master.now)
        master.wait(0.02)
    assert all(0 < frame.can_id <= 0x7FF and len(frame.data) <= 8 for frame in master.seen)
    master.nmt(0x81)
    master.wait(0.1)
    assert [master.read(node, 0x1018, 4) for node in NODES] == list(NODES)
    assert master.sync() == {}


SDO = st.builds(
    lambda command, index, sub, rest: bytes((command,)) + index.to_bytes(2, "little") + bytes((sub,)) + rest,
    st.integers(0, 255),
    st.sampled_from([0x1003, 0x1005, 0x1008, 0x1014, 0x1016, 0x1017, 0x1400, 0x1600, 0x1800, 0x1A00, 0x6040, 0x60FF]),
    st.integers(0, 9),
    st.binary(min_size=4, max_size=4),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(SDO, max_size=40))
def test_every_sdo_request_gets_at_most_one_answer(requests: list[bytes]) -> None:
    """Whatever is configured by arbitrary requests, SYNCs and time raise no exception."""
    master = Master([KAPVIK[0]])
    for request in requests:
        answers = [frame for frame in master.send(0x601, request) if frame.can_id == 0x581]
        assert len(answers) <= 1
        assert all(len(frame.data) == 8 for frame in answers)
    master.nmt(1)
    master.sync()
    master.rover.inject_fault("emcy 1 0x1000")
    master.wait(0.3)
    assert all(0x80 < frame.can_id <= 0x7FF for frame in master.seen)
