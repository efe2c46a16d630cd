"""Publishes the result of a comparison: `report`, `mismatch` and `alarm/mismatch`, retained, in one connection."""

from __future__ import annotations

import gzip
import time
from base64 import b64encode
from pathlib import Path
from typing import TYPE_CHECKING

from aiomqtt import Client

from regolithd.daemon.messages.alarm import AlarmMessage, Severity
from regolithd.daemon.messages.header import iso_time, time_fields
from regolithd.daemon.messages.mismatch import MismatchMessage, ReportMessage
from regolithd.daemon.publish.connection import password_of, tls_context
from regolithd.daemon.publish.publisher import new_session

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.messages.header import Header
    from regolithd.daemon.messages.mismatch import ComparisonResult

REMEDY = "Read the report. Repair the rover; or copy the corrected simulation, beside the report, to SIM.toml."
_AT_LEAST_ONCE = 1


async def publish_comparison(configuration: Configuration, result: ComparisonResult) -> None:
    """Publish a result and its report; the alarm is active if physics is missing or an effect has changed.

    Raises
    ------
    MqttError, OSError
        The report cannot be read, or the broker cannot be reached or does not acknowledge.
    """
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
        for topic, sent in _messages(result, time.time_ns()).items():
            await client.publish(f"{root}/{topic}", sent.model_dump_json(), qos=_AT_LEAST_ONCE, retain=True)


def _messages(result: ComparisonResult, now_ns: int) -> dict[str, Header]:
    """Return the message of each topic; the report comes first, so that it is there when the result is shown."""
    header = {"session": new_session(now_ns), "sequence": 0, **time_fields(now_ns)}
    message = MismatchMessage.model_validate(header | result.model_dump())
    page = b64encode(gzip.compress(Path(result.report).read_bytes(), mtime=0))
    alarm = {
        "name": "mismatch",
        "active": message.verdict == "missing-physics" or bool(message.changes),
        "severity": Severity.WARNING,
        "since": iso_time(now_ns),
        "text": message.text,
        "remedy": REMEDY,
    }
    return {
        "report": ReportMessage.model_validate(header | {"recording": result.recording, "html_gzip": page}),
        "mismatch": message,
        "alarm/mismatch": AlarmMessage.model_validate(header | alarm),
    }
