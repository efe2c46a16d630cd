"""Checks the MQTT broker: whether it can be reached, and accepts the credentials."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING

from aiomqtt import Client, MqttError

from regolithd.daemon.check.finding import Finding, good, wrong
from regolithd.daemon.control.protocol import CONNECTED
from regolithd.daemon.publish.broker_client import AIOMQTT_LOG
from regolithd.daemon.publish.connection_errors import explain
from regolithd.daemon.publish.credentials import password_of, tls_context
from regolithd.daemon.publish.transport import transport_of

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.control.protocol import Status

TIMEOUT_S = 5.0


async def check_broker(configuration: Configuration, running: Status | None = None) -> list[Finding]:
    """Connect and disconnect; nothing is published. Where a daemon runs, its connection counts: it must not be ended.

    (A broker that takes the user name for the client identifier ends it when another client with this name connects.)
    """
    mqtt = configuration.mqtt
    transport = transport_of(mqtt)
    if running is not None and running.broker == CONNECTED:
        return [good("broker", f"{mqtt.address}: the running daemon is connected")]
    began = time.monotonic()
    try:
        transport.check_accepts()
        client = Client(
            transport.host,
            transport.port,
            transport=transport.kind,
            username=mqtt.username,
            password=password_of(mqtt),
            identifier=f"regolithd-check-{time.time_ns():x}",
            timeout=TIMEOUT_S,
            tls_context=tls_context(mqtt),
            logger=AIOMQTT_LOG,
        )
        async with asyncio.timeout(2 * TIMEOUT_S), client:
            took = time.monotonic() - began
    except (MqttError, OSError) as error:  # OSError: the password file, the certificate, no answer
        place, _, rest = (await explain(error, mqtt)).partition(": ")
        text, _, remedy = rest.partition(". ")
        return [wrong("broker", f"{place.removeprefix('MQTT broker ')}: {text}", remedy)]
    secured = "Unix socket" if mqtt.socket else "TLS" if mqtt.tls else "no TLS"
    holder = f"the holder of {mqtt.cert_file}" if mqtt.cert_file else "anyone (no username)"
    who = mqtt.username or holder
    return [good("broker", f"{mqtt.address} accepts {who}, {secured}, after {1e3 * took:.0f} ms")]
