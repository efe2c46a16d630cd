"""The MQTT client on sockets that are closed at any moment."""

import asyncio
import math
import socket
from unittest.mock import Mock

import pytest
from aiomqtt import MqttError

from regolithd.daemon.publish.broker_client import BrokerClient


async def test_a_socket_is_awaited_only_where_it_takes_no_more() -> None:
    """What is published is written at once; where that is not possible, as soon as the socket is writable."""
    client, paho = BrokerClient("127.0.0.1"), Mock()
    here, there = socket.socketpair()
    paho.want_write.return_value = False
    client._on_socket_register_write(paho, None, here)
    await asyncio.sleep(0)
    paho.loop_write.assert_called_once_with()
    assert not client._loop.remove_writer(here.fileno())
    paho.want_write.return_value = True
    client._write_at_once(paho, here)
    assert client._loop.remove_writer(here.fileno())
    here.close()
    there.close()


async def test_a_socket_that_was_closed_meanwhile_is_left_alone() -> None:
    """A connection that ends while it is being set up raises nothing in the event loop."""
    client, paho = BrokerClient("127.0.0.1"), Mock()
    here, there = socket.socketpair()
    here.close()
    there.close()
    paho.want_write.return_value = True
    await asyncio.to_thread(client._on_socket_register_write, paho, None, here)
    await asyncio.sleep(0)
    paho.loop_write.assert_called_once_with()


async def test_a_call_that_takes_too_long_is_an_error_and_one_without_a_limit_is_awaited() -> None:
    """The limit is that of the client, that of the call, or none."""
    client = BrokerClient("127.0.0.1", timeout=0.01)
    with pytest.raises(MqttError, match="timed out"):
        await client._wait_for(asyncio.sleep(60), None)
    with pytest.raises(MqttError, match="timed out"):
        await client._wait_for(asyncio.sleep(60), 0.01)
    assert await client._wait_for(asyncio.sleep(0.02, "done"), math.inf) == "done"


async def test_an_error_while_writing_ends_the_connection() -> None:
    """It is kept as the reason of the disconnection, and a second one is ignored."""
    client, paho = BrokerClient("127.0.0.1"), Mock()
    paho.loop_write.side_effect = [BrokenPipeError("first"), BrokenPipeError("second")]
    client._write(paho)
    client._write(paho)
    assert str(client._disconnected.exception()) == "first"
