"""Publishes the result of a comparison: `report`, `mismatch` and `alarm/mismatch`, all retained."""

from __future__ import annotations

import asyncio
import gzip
import time
from base64 import b64encode
from pathlib import Path
from typing import TYPE_CHECKING

from regolithd.daemon.messages.alarm import AlarmMessage, Severity
from regolithd.daemon.messages.header import iso_time
from regolithd.daemon.messages.mismatch import MismatchMessage, ReportMessage

if TYPE_CHECKING:
    from regolithd.daemon.messages.mismatch import ComparisonResult
    from regolithd.daemon.publish.publisher import Publisher

REMEDY = "Read the report. Repair the rover; or copy the corrected simulation, beside the report, to SIM.toml."


async def publish_comparison(publisher: Publisher, result: ComparisonResult) -> None:
    """Publish a result and its report; the alarm is active if physics is missing or an effect has changed.

    The report comes first, so that it is there when the result is shown. `regolithd monitor` has none.

    Raises
    ------
    OSError
        The report cannot be read.
    """
    # Compressing takes as long as several SYNC periods at 100 Hz: hence a thread.
    page = await asyncio.to_thread(_compressed, Path(result.report)) if result.report else b""
    now_ns = time.time_ns()
    if page:
        publisher.publish("report", ReportMessage, time_ns=now_ns, recording=result.recording, html_gzip=page)
    publisher.publish("mismatch", MismatchMessage, time_ns=now_ns, **result.model_dump())
    publisher.publish(
        "alarm/mismatch",
        AlarmMessage,
        time_ns=now_ns,
        name="mismatch",
        active=result.verdict == "missing-physics" or bool(result.changes),
        severity=Severity.WARNING,
        since=iso_time(now_ns),
        text=result.text,
        remedy=REMEDY,
    )


def _compressed(report: Path) -> bytes:
    return b64encode(gzip.compress(report.read_bytes(), mtime=0))
