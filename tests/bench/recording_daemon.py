"""A recording daemon and its virtual rover in one process that tests can kill.

    python tests/bench/recording_daemon.py FOLDER RATE_HZ

Prints a line for each snapshot that is handed to the recorder: its sequence and its time in ns.
"""

import asyncio
import sys
from pathlib import Path

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.snapshot import Estimate
from regolithd.daemon.service import Service
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.master.events import NetworkEvent
from regolithd.drivers.virtual import Bench, VirtualRover


class Printer:
    """A sink to standard output."""

    def estimate(self, estimate: Estimate) -> None:
        """Print sequence and time of the snapshot."""
        print(estimate.snapshot.sequence, estimate.snapshot.time_ns, flush=True)

    def event(self, event: NetworkEvent) -> None:
        """Ignore the event."""

    async def run(self) -> None:
        """Wait until the process is killed."""
        await asyncio.Event().wait()


async def main(folder: Path, rate_Hz: float) -> None:
    """Run until killed."""
    configuration = Configuration.model_validate(
        {
            "bus": {"interface": "virtual", "channel": "killed"},
            "sync": {"rate_Hz": rate_Hz},
            "recording": {"directory": folder},
        }
    )
    async with open_bus("virtual", "killed") as bus, asyncio.TaskGroup() as tasks:
        service = Service(configuration, load_models(configuration))
        service.sinks.append(Printer())
        tasks.create_task(VirtualRover(Bench()).run(bus))
        tasks.create_task(service.run())


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), float(sys.argv[2])))
