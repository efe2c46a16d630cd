"""The virtual nodes' SDO server: transfers and abort codes of CiA 301."""

from __future__ import annotations

import struct

import canopen
import pytest
from virtual_master import MOTOR_TPDO, AbortedError, Master

from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.virtual import KAPVIK, Bench, VirtualRover


@pytest.fixture
def master() -> Master:
    """A master before the whole rover."""
    return Master()


@pytest.mark.parametrize("description", KAPVIK, ids=lambda each: f"node {each.node_id}")
def test_every_object_of_the_eds_can_be_read(master: Master, description: canopen.ObjectDictionary) -> None:
    """Each number of the EDS has its default value, measurements and serial number apart."""
    node = description.node_id
    od = canopen.import_od(str(description.device.eds), node)
    live = {0x1018, 0x2F00, 0x6041, 0x6079, 0x9130}
    for entry in od.values():
        for variable in [entry] if isinstance(entry, canopen.objectdictionary.ODVariable) else entry.values():
            if variable.index == 0x1008:
                continue
            value = master.read(node, variable.index, variable.subindex)
            if variable.index not in live:
                assert value == variable.default % (1 << len(variable)), variable.name


def test_a_string_is_read_in_segments(master: Master) -> None:
    """Object 0x1008 is longer than four bytes: the size comes first, then segments with alternating toggle bit."""
    first = master.request(1, struct.pack("<BHBI", 0x40, 0x1008, 0, 0))
    assert first == struct.pack("<BHBI", 0x41, 0x1008, 0, 9)
    assert master.request(1, b"\x60" + bytes(7)) == b"\x00EPOS 24"
    assert master.request(1, b"\x70" + bytes(7)) == b"\x1b/1" + bytes(5)


def test_a_number_may_be_written_in_segments(master: Master) -> None:
    """A segmented download has the same effect as an expedited one."""
    master.request(1, struct.pack("<BHBI", 0x21, 0x6083, 0, 4))
    assert master.request(1, b"\x07" + struct.pack("<I", 1234) + bytes(3)) == b"\x20" + bytes(7)
    assert master.read(1, 0x6083) == 1234


REFUSED = [
    ("an index that is not there", 0x5FFF, 0, 1, 1, 0x06020000),
    ("a sub-index that is not there", 0x1018, 9, 1, 4, 0x06090011),
    ("a read-only object", 0x6041, 0, 1, 2, 0x06010002),
    ("a constant", 0x1000, 0, 1, 4, 0x06010002),
    ("too many bytes", 0x1017, 0, 1, 4, 0x06070012),
    ("too few bytes", 0x6083, 0, 1, 2, 0x06070013),
    ("too high a value", 0x605A, 0, 9, 2, 0x06090031),
    ("too low a value", 0x6083, 0, 0, 4, 0x06090032),
    ("an error history that is not being cleared", 0x1003, 0, 3, 1, 0x06090030),
    ("a SYNC producer", 0x1005, 0, 0x4000_0080, 4, 0x06090030),
    ("an EMCY on the NMT's identifier", 0x1014, 0, 0x000, 4, 0x06090030),
    ("a reserved transmission type", 0x1800, 2, 245, 1, 0x06090030),
    ("a PDO on an SDO's identifier", 0x1800, 1, 0x601, 4, 0x06090030),
    ("a PDO of 29 bits", 0x1800, 1, 0x2000_0181, 4, 0x06090030),
    ("a mapping entry while the mapping is in force", 0x1A00, 1, 0x60780010, 4, 0x06010000),
    ("nine mapped objects", 0x1A00, 0, 9, 1, 0x06040042),
]


@pytest.mark.parametrize("case", [case[1:] for case in REFUSED], ids=[case[0] for case in REFUSED])
def test_invalid_requests_are_aborted(master: Master, case: tuple[int, int, int, int, int]) -> None:
    """Each is aborted with the code of CiA 301."""
    index, sub, value, size, code = case
    with pytest.raises(AbortedError, match=f"0x{code:08X}"):
        master.write(1, index, sub, value, size)


MAPPINGS = [
    ("an object that is not there", [0x5FFF0010], 0x06020000),
    ("an object that may not be mapped", [0x10180120], 0x06040041),
    ("the wrong length", [0x60410008], 0x06040041),
    ("more than eight bytes", [0x60410010, 0x606C0020, 0x60790020], 0x06040042),
]


@pytest.mark.parametrize(("entries", "code"), [m[1:] for m in MAPPINGS], ids=[m[0] for m in MAPPINGS])
def test_a_wrong_mapping_is_refused(master: Master, entries: list[int], code: int) -> None:
    """It is refused at the entry, or at the number of entries that would enable it."""

    def configure() -> None:
        master.write(1, 0x1A00, 0, 0, 1)
        for sub, entry in enumerate(entries, start=1):
            master.write(1, 0x1A00, sub, entry, 4)
        master.write(1, 0x1A00, 0, len(entries), 1)

    with pytest.raises(AbortedError, match=f"0x{code:08X}"):
        configure()


def test_an_enabled_pdo_is_not_remapped(master: Master) -> None:
    """It must be disabled first (COB-ID bit 31), also for another COB-ID (CiA 301)."""
    master.configure(1, tpdo=MOTOR_TPDO)
    with pytest.raises(AbortedError, match="0x06010000"):
        master.write(1, 0x1A00, 0, 0, 1)
    with pytest.raises(AbortedError, match="0x06090030"):
        master.write(1, 0x1800, 1, 0x281, 4)


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (b"\xa0\x08\x10\x00\x00\x00\x00\x00", 0x05040001),  # block upload, which is optional
        (b"\xc2\x17\x10\x00\x02\x00\x00\x00", 0x05040001),  # block download
        (b"\x60" + bytes(7), 0x05040001),  # a segment without a transfer
        (b"\x00" + bytes(7), 0x05040001),
        (b"\xff" * 8, 0x05040001),
    ],
)
def test_an_unknown_command_is_aborted(master: Master, request_: bytes, code: int) -> None:
    """Every request of eight bytes is answered."""
    with pytest.raises(AbortedError, match=f"0x{code:08X}"):
        master.request(1, request_)


def test_a_toggle_bit_must_alternate(master: Master) -> None:
    """A repeated segment request means a lost frame and ends the transfer."""
    master.request(1, struct.pack("<BHBI", 0x40, 0x1008, 0, 0))
    master.request(1, b"\x60" + bytes(7))
    with pytest.raises(AbortedError, match="0x05030000"):
        master.request(1, b"\x60" + bytes(7))


def test_a_frame_that_is_too_short_gets_no_answer(master: Master) -> None:
    """An SDO frame has eight bytes."""
    assert master.send(0x601, b"\x40\x00\x10") == []


async def test_the_client_of_python_canopen_is_served() -> None:
    """It reads and writes over python-can, segmented as well."""
    import asyncio  # noqa: PLC0415  # only here

    rover = VirtualRover(Bench())
    async with open_bus("virtual", "sdo-canopen") as bus, asyncio.TaskGroup() as tasks:
        serving = tasks.create_task(rover.run(bus))

        def talk() -> None:
            network = canopen.Network()
            network.connect(interface="virtual", channel="sdo-canopen")
            try:
                node = network.add_node(3, str(MOTOR_CONTROLLER.eds))
                node.sdo.RESPONSE_TIMEOUT = 5
                assert node.sdo[0x1008].raw == "EPOS 24/1"
                node.sdo[0x6083].raw = 777
                assert node.sdo[0x6083].raw == 777
                with pytest.raises(canopen.SdoAbortedError) as refused:
                    node.sdo[0x6041].raw = 1
                assert refused.value.code == 0x06010002
            finally:
                network.disconnect()

        await asyncio.sleep(0.1)  # boot-up
        await asyncio.to_thread(talk)
        serving.cancel()
