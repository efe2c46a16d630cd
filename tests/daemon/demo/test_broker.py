"""The broker inside the demo's process."""

from __future__ import annotations

import asyncio

import pytest
from aiomqtt import Client, MqttError, ProtocolVersion, Will

from regolithd.daemon.demo.broker import embedded_broker

WILL = Will("rover/state", b"gone", qos=1, retain=True)


async def test_a_client_of_mqtt_5_is_told_that_there_is_none() -> None:
    """At once, with or without a will: a daemon then speaks MQTT 3.1.1."""
    async with embedded_broker() as port:
        for will in (None, WILL):
            client = Client("127.0.0.1", port, protocol=ProtocolVersion.V5, will=will, identifier="five", timeout=5)
            with pytest.raises(MqttError, match="Unsupported protocol version"):
                async with client:
                    pass


async def test_a_client_of_mqtt_3_1_1_is_served() -> None:
    """What it publishes comes back to it; its first bytes are not lost, although the broker looked at them."""
    async with embedded_broker() as port:
        client = Client("127.0.0.1", port, protocol=ProtocolVersion.V311, will=WILL, identifier="three", timeout=5)
        async with client:
            await client.subscribe("rover/#", qos=1)
            await client.publish("rover/load", b"48.5", qos=1)
            async with asyncio.timeout(5):
                message = await anext(aiter(client.messages))
        assert (str(message.topic), message.payload) == ("rover/load", b"48.5")


async def test_what_is_no_connect_is_refused() -> None:
    """A few bytes and the end: the broker closes, and goes on."""
    async with embedded_broker() as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"\x10\x05")
        writer.write_eof()
        assert await reader.read() == b"\x20\x02\x00\x01"
        writer.close()
        async with Client("127.0.0.1", port, protocol=ProtocolVersion.V311, identifier="next", timeout=5):
            pass
