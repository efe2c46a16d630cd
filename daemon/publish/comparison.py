"""Publishes the result of a comparison: `mismatch` and `alarm/mismatch`, both retained, in one connection."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from aiomqtt import Client

from regolithd.daemon.messages.alarm import AlarmMessage, Severity
from regolithd.daemon.messages.header import iso_time, time_fields
from regolithd.daemon.messages.mismatch import MismatchMessage
from regolithd.daemon.publish.connection import password_of, tls_context
from regolithd.daemon.publish.publisher import new_session

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.messages.mismatch import ComparisonResult

REMEDY = "Read the report; correct the rover, or the simulation (`regolithd mismatch --corrected`)."
_AT_LEAST_ONCE = 1


async def publish_comparison(configuration: Configuration, result: ComparisonResult) -> None:
    """Publish a result; the alarm is active if physics is missing or an effect has changed.

    Raises
    ------
    MqttError, OSError
        The broker cannot be reached, or does not acknowledge.
    """
    now_ns = time.time_ns()
    header = {"session": new_session(now_ns), "sequence": 0, **time_fields(now_ns)}
    message = MismatchMessage.model_validate(header | result.model_dump())
    alarm = AlarmMessage.model_validate(
        header
        | {
            "name": "mismatch",
            "active": message.verdict == "missing-physics" or bool(message.changes),
            "severity": Severity.WARNING,
            "since": iso_time(now_ns),
            "text": message.text,
            "remedy": REMEDY,
        }
    )
    mqtt = configuration.mqtt
    root = f"{mqtt.prefix}/{configuration.rover.name}"
    async with Client(
        mqtt.host,
        mqtt.port,
        username=mqtt.username,
        password=password_of(mqtt),
        identifier=f"regolithd-compare-{configuration.rover.name}",
        tls_context=tls_context(mqtt),
    ) as client:
        for topic, sent in (("mismatch", message), ("alarm/mismatch", alarm)):
            await client.publish(f"{root}/{topic}", sent.model_dump_json(), qos=_AT_LEAST_ONCE, retain=True)
