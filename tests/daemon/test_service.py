"""The whole path in one process: virtual nodes, bus, service, recording, and the same numbers from the log."""

import asyncio
import csv
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from regolithd.daemon.cli import app
from regolithd.daemon.config.configuration import Configuration, Recording
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.snapshot import Estimate
from regolithd.daemon.recording.digest import Digest
from regolithd.daemon.recording.export import HEADER, ExportError, export
from regolithd.daemon.recording.mcap_file import read_messages
from regolithd.daemon.service import NETWORK, Service, event_json
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.canopen.emcy import Emergency
from regolithd.drivers.canopen.sync import SyncCounters
from regolithd.drivers.master.events import NetworkEvent, NodeEmergency
from regolithd.drivers.virtual import Bench, VirtualRover


@dataclass
class Listener:
    """A sink that keeps what it gets."""

    digest: Digest = field(default_factory=Digest)
    valid: list[list[bool]] = field(default_factory=list)
    measured: list[list[bool]] = field(default_factory=list)
    events: list[str] = field(default_factory=list)
    cancelled: bool = False

    def estimate(self, estimate: Estimate) -> None:
        """Keep what is compared."""
        self.digest.add(estimate)
        self.valid.append(estimate.valid.tolist())
        self.measured.append(estimate.snapshot.valid.tolist())

    def event(self, event: NetworkEvent) -> None:
        """Keep its name."""
        self.events.append(type(event).__name__)

    async def run(self) -> None:
        """Wait for cancellation."""
        try:
            await asyncio.Event().wait()
        finally:
            self.cancelled = True

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait for a condition; the test's time limit ends it otherwise."""
        while not condition():  # noqa: ASYNC110  # whatever is waited for, it has no event of its own
            await asyncio.sleep(0.02)


@pytest.fixture
def running(tmp_path: Path, configuration: Configuration) -> Callable:
    """Return a context in which a rover drives and a service runs at 20 Hz; it ends by cancellation, as by SIGTERM."""
    settings = configuration.model_dump() | {
        "bus": {"interface": "virtual", "channel": f"service-{tmp_path.name}"},
        "sync": {"rate_Hz": 20.0},
        "recording": {"directory": tmp_path / "recordings"},
    }

    @asynccontextmanager
    async def run() -> AsyncIterator[tuple[Service, Listener, VirtualRover]]:
        changed = Configuration.model_validate(settings)
        bus = changed.bus
        listener = Listener()
        rover = VirtualRover(Bench())
        async with (
            open_bus(bus.interface, bus.channel) as theirs,
            asyncio.TaskGroup() as tasks,
        ):
            service = Service(changed, load_models(changed))
            service.sinks.append(listener)
            virtual = tasks.create_task(rover.run(theirs))
            task = tasks.create_task(service.run())
            network = await service.opened()
            await listener.until(lambda: all(each.phase == "operational" for each in network.status.values()))
            yield service, listener, rover
            task.cancel()
            await asyncio.wait([task])
            virtual.cancel()

    return run


async def test_a_rover_drives_is_recorded_replayed_and_exported(running: Callable, tmp_path: Path) -> None:
    """The replay of the log equals the live run to the last bit, and the export has every snapshot."""
    async with running() as (service, listener, rover):
        await service.network.enable()
        await service.network.set_speed((0.29,) * 6)
        await listener.until(lambda: sum(all(valid) for valid in listener.valid) >= 20)
        mcap, log = service.recorder.paths
    assert listener.cancelled
    assert listener.events.count("NodeBooted") >= 14
    assert all(node.device.speed_rad_s == 0 for node in rover.nodes.values() if hasattr(node.device, "speed_rad_s"))

    shown = CliRunner().invoke(app, ["replay", str(log)])
    assert shown.exit_code == 0, shown.output
    assert f"digest     {listener.digest}" in shown.output
    assert f"identical  to the last bit with the {2 * listener.digest.count} messages" in shown.output

    count = export([mcap], tmp_path / "out.csv")
    with (tmp_path / "out.csv").open() as stream:
        table = list(csv.reader(stream))
    assert tuple(table[0]) == HEADER
    assert len(table) - 1 == count == 6 * listener.digest.count
    last = dict(zip(HEADER, table[-1], strict=True))
    assert last["wheel"] == "6"
    assert float(last["load_N"]) == 55.0
    assert last["bus_voltage_V"] == ""  # nobody was asked for it

    assert export([mcap], tmp_path / "out.parquet") == count
    assert pq.read_table(tmp_path / "out.parquet").column_names == list(HEADER)
    with pytest.raises(ExportError, match=r"Name it \.csv, \.parquet or \.nc"):
        export([mcap], tmp_path / "out.xlsx")


async def test_a_node_that_falls_silent_is_an_event_and_its_wheel_invalid_and_the_rest_goes_on(
    running: Callable,
) -> None:
    """Load cell 13 loses its power and gets it back."""
    async with running() as (service, listener, rover):
        await service.network.enable()
        await service.network.set_speed((0.29,) * 6)
        await listener.until(lambda: bool(listener.valid) and all(listener.valid[-1]))
        rover.inject_fault("off 13")
        await listener.until(lambda: "NodeLost" in listener.events)
        mcap = service.recorder.paths[0]
        service.recorder.flush()
        rover.inject_fault("on 13")
        await listener.until(lambda: all(listener.measured[-1]))
    assert [True, True, False, True, True, True] in listener.measured
    recorded = [message.content["event"] for message in read_messages(mcap) if message.topic == "event"]
    assert "NodeLost" in recorded


async def test_a_log_that_was_changed_is_found_out(running: Callable) -> None:
    """One changed bit of one current makes the replay fail, and names the quantity."""
    async with running() as (service, listener, _):
        await listener.until(lambda: listener.digest.count >= 5)
        log = service.recorder.paths[1]
    lines = log.read_text().splitlines(keepends=True)
    at = max(place for place, line in enumerate(lines) if " 181#" in line)
    nibble = lines[at].index("#") + 6
    lines[at] = lines[at][:nibble] + format(int(lines[at][nibble], 16) ^ 1, "X") + lines[at][nibble + 1 :]
    log.write_text("".join(lines))
    shown = CliRunner().invoke(app, ["replay", str(log)])
    assert shown.exit_code == 1
    assert "motor_current_A" in shown.output


async def test_a_slow_task_starves_the_watchdog(running: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    """While a task is overdue, the watchdog is not fed and STATUS names the task."""
    told: list[str] = []
    monkeypatch.setattr("regolithd.daemon.service.notify", told.append)
    monkeypatch.setenv("WATCHDOG_USEC", "200000")
    monkeypatch.delenv("WATCHDOG_PID", raising=False)
    async with running() as (service, listener, _):
        await listener.until(lambda: "WATCHDOG=1" in told)
        service.liveness.expect("stuck", 0.1)
        await listener.until(lambda: "STATUS=no answer from stuck" in told)
        fed = told.count("WATCHDOG=1")
        await listener.until(lambda: told.count("STATUS=no answer from stuck") > 3)
        assert told.count("WATCHDOG=1") == fed
    assert told[0].startswith("READY=1\n")
    assert told[-1] == "STOPPING=1"


@pytest.mark.parametrize("counter", ["produced", "failed", "skipped"])
def test_the_network_task_runs_while_a_sync_is_tried(counter: str, configuration: Configuration) -> None:
    """A SYNC that cannot be sent, or that is left out, shows as well as one that is sent that the task is alive."""
    settings = configuration.model_copy(update={"recording": Recording(enabled=False)})
    service, sync = Service(settings, load_models(settings)), SyncCounters()
    told: list[str] = []
    service.liveness.beat = told.append  # type: ignore[method-assign]
    network: Any = SimpleNamespace(counters=SimpleNamespace(sync=sync))
    for _ in range(3):
        setattr(sync, counter, getattr(sync, counter) + 1)
        service._check_sync_progress(network)
    assert told == [NETWORK] * 3
    service._check_sync_progress(network)
    assert told == [NETWORK] * 3


def test_events_are_json() -> None:
    """An event with bytes and nested objects is encoded."""
    event = NodeEmergency(1, 3, Emergency(1, 3, 0x8130, 0x11, b"\x00\x01\x02\x03\x04", "heartbeat"), "node 3: …")
    assert json.loads(event_json(event))["emergency"]["vendor"] == "0001020304"
