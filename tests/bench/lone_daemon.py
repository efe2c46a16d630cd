"""A whole daemon in a process of its own, on an in-process bus without any node: to be killed.

    python lone_daemon.py CONFIG

Every SYNC still gives a snapshot, in which nothing was measured.
"""

from __future__ import annotations

import asyncio
import signal
import sys
from pathlib import Path

from daemon.config_reader import read_configuration
from daemon.equipment import equip
from daemon.estimate import SHIPPED_MODEL, Network
from daemon.service import Service


async def main(path: Path) -> None:
    """Run until SIGTERM."""
    service = Service(read_configuration(path), Network(SHIPPED_MODEL))
    equip(service)
    task = asyncio.create_task(service.run())
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    await asyncio.wait([task])
    if not task.cancelled():
        task.result()


asyncio.run(main(Path(sys.argv[1])))
