"""A daemon on an in-process bus without any node, as a process that tests can kill.

    python daemon_without_nodes.py CONFIG

Every SYNC gives a snapshot in which nothing was measured.
"""

from __future__ import annotations

import asyncio
import signal
import sys
from pathlib import Path

from regolithd.daemon.config.reader import read_configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.service import Service
from regolithd.daemon.wiring import connect_sinks


async def main(path: Path) -> None:
    """Run until SIGTERM."""
    configuration = read_configuration(path)
    service = Service(configuration, load_models(configuration))
    connect_sinks(service)
    task = asyncio.create_task(service.run())
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    await asyncio.wait([task])
    if not task.cancelled():
        task.result()


asyncio.run(main(Path(sys.argv[1])))
