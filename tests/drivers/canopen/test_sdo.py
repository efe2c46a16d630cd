"""The SDO protocol: the bytes of the standard, a round trip through the virtual server, and arbitrary answers."""

from __future__ import annotations

import asyncio
import socket
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen.sdo import Transfer, abort_text, download, upload
from regolithd.drivers.canopen.sdo_client import SdoClient
from regolithd.drivers.errors import (
    BusDownError,
    SdoAbortError,
    SdoError,
    SdoInterruptedError,
    SdoProtocolError,
    SdoTimeoutError,
)


def run(transfer: Transfer, *answers: str) -> tuple[list[str], bytes | None]:
    """Feed answers (hex) to a transfer; return its requests and its result (None: it wants more)."""
    requests = [next(transfer)]
    try:
        for answer in answers:
            request = transfer.send(bytes.fromhex(answer))
            requests.append(request)  # a comprehension would turn StopIteration into an error
    except StopIteration as end:
        return [request.hex(" ") for request in requests if request], end.value
    return [request.hex(" ") for request in requests if request], None


def test_expedited_upload() -> None:
    """Four bytes, two bytes, and an answer without size are read."""
    assert run(upload(0x1018, 1), "43 18 10 01 fb 00 00 00") == (["40 18 10 01 00 00 00 00"], b"\xfb\0\0\0")
    assert run(upload(0x6041, 0), "4b 41 60 00 37 06 00 00")[1] == b"\x37\x06"
    assert run(upload(0x6041, 0), "42 41 60 00 37 06 00 00")[1] == b"\x37\x06\0\0"


def test_expedited_download() -> None:
    """One, two and four bytes are written."""
    for data, request in (("01", "2f 60 60 00 01 00 00 00"), ("0f00", "2b 60 60 00 0f 00 00 00")):
        assert run(download(0x6060, 0, bytes.fromhex(data)), "60 60 60 00 00 00 00 00") == ([request], b"")
    assert run(download(0x1016, 1, bytes(4)))[0] == ["23 16 10 01 00 00 00 00"]


def test_segmented_upload() -> None:
    """Nine characters are read in two segments with an alternating toggle bit."""
    requests, data = run(
        upload(0x1008, 0), "41 08 10 00 09 00 00 00", "00 45 50 4f 53 20 32 34", "1b 2f 31 00 00 00 00 00"
    )
    assert data == b"EPOS 24/1"
    assert requests[1:] == ["60 00 00 00 00 00 00 00", "70 00 00 00 00 00 00 00"]


def test_segmented_download() -> None:
    """The size is sent first, then seven bytes at a time, and the last segment is marked."""
    requests, _ = run(
        download(0x1008, 0, b"EPOS 24/1"),
        "60 08 10 00 00 00 00 00",
        "20 00 00 00 00 00 00 00",
        "30 00 00 00 00 00 00 00",
    )
    assert requests == ["21 08 10 00 09 00 00 00", "00 45 50 4f 53 20 32 34", "1b 2f 31 00 00 00 00 00"]


def test_a_late_answer_for_another_object_is_ignored() -> None:
    """It belongs to a transfer that has timed out before."""
    requests, data = run(upload(0x6041, 0), "4b 78 60 00 01 00 00 00", "4b 41 60 00 37 06 00 00")
    assert (len(requests), data) == (1, b"\x37\x06")


def test_an_abort_has_code_object_and_text() -> None:
    """The error of an aborted transfer names the code, the object and the meaning."""
    with pytest.raises(SdoAbortError, match=r"object 0x1A00:01: aborted with 0x06040041: object cannot be mapped"):
        run(download(0x1A00, 1, bytes(4)), "80 00 1a 01 41 00 04 06")
    assert "not define" in abort_text(0x12345678)


@pytest.mark.parametrize(
    "answers",
    [
        ("43 18 10 01 fb",),  # too short
        ("60 18 10 01 00 00 00 00",),  # the answer to a download
        ("41 18 10 01 09 00 00 00", "10 00 00 00 00 00 00 00"),  # toggle bit not alternated
        ("41 18 10 01 09 00 00 00", "01 00 00 00 00 00 00 00"),  # seven bytes of nine
        ("41 18 10 01 09 00 00 00", "60 00 00 00 00 00 00 00"),  # not a segment
    ],
)
def test_a_protocol_violation_is_an_error(answers: tuple[str, ...]) -> None:
    """Each violation of the protocol raises an `SdoProtocolError` that describes it."""
    with pytest.raises(SdoProtocolError):
        run(upload(0x1018, 1), *answers)


@given(st.sampled_from(["read", "write"]), st.lists(st.binary(max_size=8), max_size=20), st.binary(max_size=30))
def test_any_answer_ends_in_a_value_or_an_sdo_error(way: str, answers: list[bytes], data: bytes) -> None:
    """Arbitrary answers of a node raise no other exception."""
    transfer = upload(0x1018, 1) if way == "read" else download(0x1018, 1, data)
    next(transfer)
    try:
        for answer in answers:
            transfer.send(answer[:1] + b"\x18\x10\x01" + answer[4:] if len(answer) == 8 else answer)
    except (StopIteration, SdoError):
        pass


class Wire:
    """A bus that keeps what is sent, and may refuse it."""

    def __init__(self, *, down: bool = False) -> None:
        self.sent: list[Frame] = []
        self.down = down

    async def send(self, frame: Frame) -> None:
        """Keep a frame."""
        if self.down:
            raise BusDownError("vcan0: cannot send")
        self.sent.append(frame)


async def test_a_timeout_aborts_the_transfer() -> None:
    """Without an answer an `SdoTimeoutError` is raised, and the abort is sent to the node."""
    wire = Wire()
    client = SdoClient(wire, 5, timeout_s=0.05)
    with pytest.raises(SdoTimeoutError, match=r"node 5, object 0x6041:00: no answer within 0.05 s\. Is the node"):
        await client.read(0x6041)
    assert [frame.data.hex() for frame in wire.sent] == ["4041600000000000", "8041600000000405"]
    assert (client.transfers, client.failures) == (1, 1)


async def test_an_answer_that_waits_while_this_program_is_late_is_taken() -> None:
    """A program that stands still for longer than the timeout reads the answer afterwards."""
    client = SdoClient(Wire(), 5, timeout_s=0.05)
    node, socket_of_bus = socket.socketpair()
    loop = asyncio.get_running_loop()
    loop.add_reader(
        socket_of_bus, lambda: loop.call_soon(client.handle, Frame(0, 0x585, socket_of_bus.recv(8)))
    )  # as a bus does: one task reads, another is woken
    try:
        reading = asyncio.ensure_future(client.read_number(0x6041))
        await asyncio.sleep(0)
        node.send(bytes.fromhex("4b41600037060000"))
        time.sleep(0.2)  # noqa: ASYNC251  # the program stands still
        assert await reading == 0x0637
        assert client.failures == 0
    finally:
        loop.remove_reader(socket_of_bus)
        node.close()
        socket_of_bus.close()


async def test_transfers_are_sequential() -> None:
    """Two concurrent reads are two transfers, one after the other."""
    wire = Wire()
    client = SdoClient(wire, 5, timeout_s=5.0)
    first, second = asyncio.ensure_future(client.read_number(0x6041)), asyncio.ensure_future(client.read(0x6078))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert len(wire.sent) == 1
    client.handle(Frame(0, 0x585, bytes.fromhex("4b41600037060000")))
    assert await first == 0x0637
    client.handle(Frame(0, 0x585, bytes.fromhex("4b786000b0ff0000")))
    assert await second == b"\xb0\xff"
    client.handle(Frame(0, 0x585, bytes(8)))  # nobody asked


async def test_a_restart_ends_a_transfer_at_once() -> None:
    """A node's boot-up ends the transfer before its timeout."""
    client = SdoClient(Wire(), 5, timeout_s=60.0)
    reading = asyncio.ensure_future(client.read(0x6041))
    await asyncio.sleep(0)
    client.interrupt()
    with pytest.raises(SdoInterruptedError, match="node 5"):
        await reading


async def test_a_link_that_is_down_is_a_bus_error() -> None:
    """It is not reported as a timeout of the node."""
    with pytest.raises(BusDownError):
        await SdoClient(Wire(down=True), 5, timeout_s=0.05).read(0x6041)
