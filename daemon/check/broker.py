"""Checks the MQTT broker: whether it can be reached, and accepts the credentials."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING

from aiomqtt import Client, MqttError

from regolithd.daemon.check.finding import Finding, good, wrong
from regolithd.daemon.publish.connection import password_of, tls_context
from regolithd.daemon.publish.connection_errors import reason_of

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration

TIMEOUT_S = 5.0


async def check_broker(configuration: Configuration) -> list[Finding]:
    """Connect with a separate client identifier, and disconnect; nothing is published."""
    mqtt = configuration.mqtt
    began = time.monotonic()
    try:
        client = Client(
            mqtt.host,
            mqtt.port,
            username=mqtt.username,
            password=password_of(mqtt),
            identifier=f"regolithd-check-{time.time_ns():x}",
            timeout=TIMEOUT_S,
            tls_context=tls_context(mqtt),
        )
        async with asyncio.timeout(2 * TIMEOUT_S), client:
            took = time.monotonic() - began
    except (MqttError, OSError) as error:  # OSError: the password file, the certificate, no answer
        place, _, rest = reason_of(error, mqtt).partition(": ")
        text, _, remedy = rest.partition(". ")
        return [wrong("broker", f"{place.removeprefix('MQTT broker ')}: {text}", remedy)]
    secured = "TLS" if mqtt.tls else "no TLS"
    who = mqtt.username or "anyone (no username)"
    return [good("broker", f"{mqtt.host}:{mqtt.port} accepts {who}, {secured}, after {1e3 * took:.0f} ms")]
