"""The MQTT client on sockets that are closed at any moment."""

import socket
from unittest.mock import Mock

from regolithd.daemon.publish.broker_client import BrokerClient


async def test_a_socket_that_was_closed_meanwhile_is_left_alone() -> None:
    """A connection that ends while it is being set up raises nothing in the event loop; an open one is written."""
    client, paho = BrokerClient("127.0.0.1"), Mock()
    here, there = socket.socketpair()
    client._write_when_ready(paho, here)
    assert client._loop.remove_writer(here.fileno())
    here.close()
    there.close()
    client._write_when_ready(paho, here)
    paho.loop_write.assert_not_called()


async def test_an_error_while_writing_ends_the_connection() -> None:
    """It is kept as the reason of the disconnection, and a second one is ignored."""
    client, paho = BrokerClient("127.0.0.1"), Mock()
    paho.loop_write.side_effect = [BrokenPipeError("first"), BrokenPipeError("second")]
    client._write(paho)
    client._write(paho)
    assert str(client._disconnected.exception()) == "first"
