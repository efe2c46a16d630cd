"""Runs the daemon on a virtual rover with every registered device, and prints what becomes of the measurements.

python drive.py FOLDER: the recording goes to FOLDER; the output is one JSON object.
"""

from __future__ import annotations

import asyncio
import csv
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.messages.documents import documents
from regolithd.daemon.messages.measurements import SnapshotMessage
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.publish.encode import encode
from regolithd.daemon.recording.export import export
from regolithd.daemon.service import Service
from regolithd.drivers import reference
from regolithd.drivers.can import open_bus
from regolithd.drivers.devices.device import Measured, PdoLayout, Quantity
from regolithd.drivers.devices.registry import DEVICES
from regolithd.drivers.virtual import KAPVIK, Bench, VirtualRover

if TYPE_CHECKING:
    from regolithd.daemon.pipeline.snapshot import Estimate


class LastEstimate:
    """A sink that keeps the newest estimate."""

    last: Estimate | None = None

    def estimate(self, estimate: Estimate) -> None:
        """Keep it."""
        self.last = estimate

    def event(self, _event: object) -> None:
        """Events are not looked at."""

    async def run(self) -> None:
        """Wait for the end."""
        await asyncio.Event().wait()


def settings(folder: Path) -> Configuration:
    """Return a configuration that names one node of every device of the body."""
    body = {device.configuration_key: device.default_node_id for device in DEVICES if not device.per_wheel}
    return Configuration.model_validate(
        {
            "bus": {"interface": "virtual", "channel": "new-device"},
            "sync": {"rate_Hz": 20.0},
            "nodes": body,
            "recording": {"directory": folder},
        }
    )


async def drive(configuration: Configuration) -> tuple[dict[int, str], Estimate]:
    """Boot all nodes; return their phases, and the first estimate after that for which every device was measured."""
    sink = LastEstimate()
    service = Service(configuration, load_models(configuration))
    service.sinks.append(sink)
    async with open_bus("virtual", "new-device") as bus, asyncio.TaskGroup() as tasks:
        rover = tasks.create_task(VirtualRover(Bench()).run(bus))
        running = tasks.create_task(service.run())
        network = await service.opened()
        while not (all(each.boots for each in network.status.values()) and complete(sink.last)):  # noqa: ASYNC110  # no event
            await asyncio.sleep(0.02)
        phases = {node_id: status.phase.value for node_id, status in network.status.items()}
        running.cancel()
        await asyncio.wait([running])
        rover.cancel()
    assert sink.last is not None
    return phases, sink.last


def complete(estimate: Estimate | None) -> bool:
    """Return whether every quantity arrived, those of diagnostic TPDOs apart."""
    wanted = (q for device in DEVICES for layout in device.tpdos if not layout.diagnostic for q in measured(layout))
    return estimate is not None and not any(np.isnan(estimate.snapshot[quantity]).any() for quantity in wanted)


def measured(layout: PdoLayout) -> list[Quantity]:
    """Return the quantities of a TPDO."""
    return [each.quantity for each in layout.objects if isinstance(each, Measured)]


def main() -> None:
    """Drive, and print the findings."""
    folder = Path(sys.argv[1])
    configuration = settings(folder)
    phases, last = asyncio.run(drive(configuration))
    message, _ = encode(last, "session")
    SnapshotMessage.model_validate_json(message)
    export(sorted(folder.glob("*.mcap")), folder / "out.csv")
    with (folder / "out.csv").open() as stream:
        row = list(csv.DictReader(stream))[-1]
    findings = {
        "nodes": [node.node_id for node in KAPVIK],
        "phases": {str(node_id): phase for node_id, phase in phases.items()},
        "message": json.loads(message),
        "row": row,
        "bus_document": reference.document(),
        "schemas": {name: text for name, text in documents().items() if name.startswith(("snapshot", "node"))},
    }
    sys.stdout.write(json.dumps(findings))


if __name__ == "__main__":
    main()
