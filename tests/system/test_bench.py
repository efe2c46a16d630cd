"""The test bench itself: the guest's vcan links and the broker, which other tests rely on."""

from __future__ import annotations

import asyncio
import socket
from typing import TYPE_CHECKING

import can
import pytest

if TYPE_CHECKING:
    from broker import Mosquitto


@pytest.mark.vcan
@pytest.mark.parametrize("channel", ["vcan0", "vcan1"])
def test_a_frame_crosses_the_link(channel: str) -> None:
    """A frame sent on a vcan link arrives at another socket on it, with a kernel time stamp."""
    with (
        can.Bus(channel, interface="socketcan") as sender,
        can.Bus(channel, interface="socketcan") as receiver,
    ):
        sender.send(can.Message(arbitration_id=0x181, data=b"regolith", is_extended_id=False))
        received = receiver.recv(10)
    assert received is not None
    assert bytes(received.data) == b"regolith"
    assert received.timestamp > 0


@pytest.mark.vcan
async def test_the_broker_runs_in_the_guest(mosquitto: Mosquitto) -> None:
    """The guest's loopback interface carries MQTT."""
    reader, writer = await asyncio.open_connection(mosquitto.host, mosquitto.port)
    writer.write(b"\x10\x0d\x00\x04MQTT\x04\x02\x00\x3c\x00\x01a")  # CONNECT, clean session, client "a"
    assert await reader.readexactly(4) == b"\x20\x02\x00\x00"  # CONNACK, accepted
    writer.close()
    await writer.wait_closed()


def test_a_broker_keeps_its_port(mosquitto: Mosquitto) -> None:
    """A broker that is stopped refuses connections, and answers on the same port when started again."""
    mosquitto.stop()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((mosquitto.host, mosquitto.port), 1)
    mosquitto.start()
    mosquitto.freeze()
    mosquitto.kill()
    mosquitto.start()
    socket.create_connection((mosquitto.host, mosquitto.port), 1).close()
