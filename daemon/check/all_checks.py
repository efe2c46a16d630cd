"""Runs all checks concurrently; the findings are in the order in which to correct them."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from regolithd.daemon.check.broker import check_broker
from regolithd.daemon.check.bus import check_bus
from regolithd.daemon.check.clock import check_clock
from regolithd.daemon.check.control import check_control, running_daemon
from regolithd.daemon.check.disk import check_disks
from regolithd.daemon.check.models import check_models
from regolithd.daemon.control.protocol import Status

if TYPE_CHECKING:
    from regolithd.daemon.check.finding import Finding
    from regolithd.daemon.config.configuration import Configuration


async def check_everything(configuration: Configuration) -> list[Finding]:
    """Return every finding."""
    running = await running_daemon(configuration)
    status = running if isinstance(running, Status) else None
    parts = await asyncio.gather(
        check_bus(configuration, status),
        check_models(configuration),
        check_broker(configuration, status),
        check_disks(configuration),
        check_clock(),
    )
    found = [finding for part in parts for finding in part]
    return found + check_control(configuration, running)
