"""Whatever the virtual rover is told to do wrong: what a subscriber hears of it, and that everything else goes on.

One daemon with a real broker lives through all of it, on a bus in this process. Load cell 13 (wheel 3) and drive 2 are
the ones that fail. Every command that the rover knows stands in `FAULTS`; a new one without an entry fails here.
"""

from __future__ import annotations

import asyncio
import json
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import aiomqtt
import pytest
import pytest_asyncio
from broker import Mosquitto, mosquitto_program

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.service import Service
from regolithd.daemon.simulator.virtual_rover import VirtualWorld
from regolithd.daemon.wiring import connect_sinks
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.virtual import VirtualRover
from regolithd.drivers.virtual.fault_injection import COMMANDS

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Iterator

pytestmark = pytest.mark.timeout(180)

RATE_HZ = 10.0
PATIENCE_S = 60.0
LOAD_CELL, WHEEL = 13, 3
DRIVE = 2
ROOT = "regolith/kapvik"


@dataclass
class Rig:
    """A running daemon, the rover it runs, and all that a subscriber has heard, as (topic, message)."""

    rover: VirtualRover
    service: Service
    heard: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    mark: int = 0

    def tell(self, *lines: str) -> None:
        """Make something wrong; what is heard from now on counts."""
        self.mark = len(self.heard)
        for line in lines:
            assert self.rover.tell(line) == "ok", line

    def since(self, topic: str, **fields: object) -> list[dict[str, Any]]:
        """Return what was heard on a topic since then, with these values."""
        return [
            message
            for at, message in self.heard[self.mark :]
            if at == f"{ROOT}/{topic}" and all(message[name] == value for name, value in fields.items())
        ]

    async def until(self, condition: Callable[[], object], what: str) -> None:
        """Wait for something to be heard."""
        end = time.monotonic() + PATIENCE_S
        while not condition():
            if time.monotonic() > end:
                latest = [
                    f"{at}: {message}" for at, message in self.heard[self.mark :] if "event" in at or "node" in at
                ]
                pytest.fail(f"not heard within {PATIENCE_S:g} s: {what}\n" + "\n".join(latest[-20:]))
            await asyncio.sleep(0.05)

    async def until_heard(self, topic: str, **fields: object) -> dict[str, Any]:
        """Wait for a message, and return it."""
        await self.until(lambda: self.since(topic, **fields), f"{topic} {fields}")
        return self.since(topic, **fields)[0]

    async def until_snapshots(self, count: int, condition: Callable[[dict[str, Any]], bool], what: str) -> None:
        """Wait until that many snapshots in a row, of those heard last, are so."""

        def so() -> bool:
            latest = self.since("snapshot")[-count:]
            return len(latest) == count and all(condition(snapshot) for snapshot in latest)

        await self.until(so, f"{count} snapshots in a row with {what}")

    async def until_well(self) -> None:
        """Wait until every node is operational and every wheel measured."""
        network = await self.service.opened()
        await self.until(lambda: {s.phase.value for s in network.status.values()} == {"operational"}, "all operational")
        await self.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")


async def listen(rig: Rig, port: int) -> None:
    """Hear everything."""
    async with aiomqtt.Client("127.0.0.1", port, identifier="faults") as client:
        await client.subscribe(f"{ROOT}/#", qos=1)
        async for message in client.messages:
            assert isinstance(message.payload, bytes)
            rig.heard.append((str(message.topic), json.loads(message.payload)))


async def live(rig: Rig, port: int, ended: asyncio.Event) -> None:
    """Run rover, daemon and subscriber until told to end."""
    async with open_bus("virtual", "faults") as bus, asyncio.TaskGroup() as tasks:
        lasting = [tasks.create_task(rig.rover.run(bus)), tasks.create_task(listen(rig, port))]
        running = tasks.create_task(rig.service.run())
        await ended.wait()
        running.cancel()
        await asyncio.wait([running])
        for task in lasting:
            task.cancel()


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mosquitto]:
    """One broker for all tests of this file."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    running = Mosquitto(tmp_path_factory.mktemp("mosquitto"))
    running.start()
    yield running
    running.stop()


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def daemon(broker: Mosquitto, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Rig]:
    """One daemon for all tests of this file, with everything that it has on a rover."""
    folder = tmp_path_factory.mktemp("faults")
    configuration = Configuration.model_validate(
        {
            "bus": {"interface": "virtual", "channel": "faults"},
            "sync": {"rate_Hz": RATE_HZ},
            "nodes": {"inclinometer": 21, "ground_speed": 22, "heartbeat_timeout_ms": 1500},
            "recording": {"directory": folder / "recordings"},
            "mqtt": {"host": "127.0.0.1", "port": broker.port, "spool_directory": folder / "spool"},
            "control": {"socket": folder / "control.sock"},
        }
    )
    service = Service(configuration, load_models(configuration))
    connect_sinks(service)
    rig, ended = Rig(VirtualRover(VirtualWorld()), service), asyncio.Event()
    # One task owns all contexts: pytest begins and ends a fixture in two different ones.
    living = asyncio.ensure_future(live(rig, broker.port, ended))
    yield rig
    ended.set()
    await living


@pytest_asyncio.fixture(loop_scope="module")
async def well(daemon: Rig) -> AsyncIterator[Rig]:
    """The daemon, all being well; afterwards everything is mended, and becomes well again."""
    await daemon.until_well()
    yield daemon
    daemon.tell("clear all", "on all")
    if any(status.phase.value != "operational" for status in (await daemon.service.opened()).status.values()):
        daemon.tell(f"reset {LOAD_CELL}")
    await daemon.until_well()
    heard = [message["sequence"] for topic, message in daemon.heard if topic == f"{ROOT}/snapshot"]
    assert heard == list(range(heard[0], heard[0] + len(heard)))  # no SYNC without its snapshot, whatever happened


def only_wheel_3_lacks(snapshot: dict[str, Any]) -> bool:
    """Whether wheel 3's load is null and its estimate not valid, and all else is there."""
    others = [measured for wheel, measured in enumerate(snapshot["measured"], start=1) if wheel != WHEEL]
    lacks = snapshot["load_N"][WHEEL - 1] is None and not snapshot["measured"][WHEEL - 1]
    return lacks and all(others) and None not in snapshot["motor_current_A"] and snapshot["pitch_rad"] is not None


# What is told, and how it is to be heard. Each function is named after its fault.


async def lost_node(rig: Rig) -> None:
    """Node, event and alarm say so; the wheel has no load, all others go on."""
    await rig.until_heard("event", kind="node-lost", node_id=LOAD_CELL)
    await rig.until_heard(f"node/{LOAD_CELL}", phase="lost")
    alarm = await rig.until_heard(f"alarm/node-{LOAD_CELL}", active=True)
    assert alarm["severity"] == "error"
    assert alarm["text"]
    assert alarm["cure"]
    await rig.until_snapshots(5, only_wheel_3_lacks, "wheel 3 lacking")


async def off(rig: Rig) -> None:
    """Power lost."""
    rig.tell(f"off {LOAD_CELL}")
    await lost_node(rig)


async def on(rig: Rig) -> None:
    """Power lost and back: booted again, the alarm ends, the value returns, and nobody restarted anything."""
    rig.tell(f"off {LOAD_CELL}")
    await lost_node(rig)
    rig.tell(f"on {LOAD_CELL}")
    await rig.until_heard("event", kind="node-booted", node_id=LOAD_CELL)
    await rig.until_heard(f"alarm/node-{LOAD_CELL}", active=False)
    await rig.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")


async def reset(rig: Rig) -> None:
    """A restart is a loss and a boot."""
    rig.tell(f"reset {LOAD_CELL}")
    await rig.until_heard("event", kind="node-lost", node_id=LOAD_CELL)
    await rig.until_heard("event", kind="node-booted", node_id=LOAD_CELL)


async def leave(rig: Rig) -> None:
    """So is leaving operational."""
    rig.tell(f"leave {LOAD_CELL}")
    await rig.until_heard("event", kind="node-lost", node_id=LOAD_CELL)
    await rig.until_heard("event", kind="node-booted", node_id=LOAD_CELL)


async def emcy(rig: Rig) -> None:
    """The code, in words, when it begins and when it ends; measuring goes on."""
    rig.tell(f"emcy {LOAD_CELL} 0x5000")
    begun = await rig.until_heard("emcy", node_id=LOAD_CELL, code="0x5000", cleared=False)
    assert begun["wheel"] == WHEEL
    assert "hardware" in begun["text"].lower()
    rig.tell(f"emcy {LOAD_CELL} 0")
    await rig.until_heard("emcy", node_id=LOAD_CELL, cleared=True)
    await rig.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")


async def fault(rig: Rig) -> None:
    """While driving: the EMCY, the drive's state, and that all others were stopped; measuring goes on."""
    network = await rig.service.opened()
    await network.enable()
    await network.set_speed((0.29,) * 6)
    await rig.until_snapshots(3, lambda snapshot: min(snapshot["motor_speed_rad_s"]) > 100, "all wheels turning")
    rig.tell(f"fault {DRIVE} 0x2310")
    await rig.until_heard("emcy", node_id=DRIVE, code="0x2310")
    await rig.until_heard("event", kind="drive-state-changed", node_id=DRIVE)
    await rig.until_heard("event", kind="motion-stopped")
    await rig.until_snapshots(3, lambda snapshot: not any(snapshot["motor_speed_rad_s"]), "all wheels standing")
    await rig.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")
    await network.enable()  # resets the fault
    await network.disable()


async def boot_failed(rig: Rig, reason: str) -> None:
    """Node, event and alarm say so, with the reason; the wheel has no load, all others go on."""
    await rig.until_heard("event", kind="node-boot-failed", node_id=LOAD_CELL)
    node = await rig.until_heard(f"node/{LOAD_CELL}", phase="failed", reason=reason)
    assert f"node {LOAD_CELL}" in node["text"]
    await rig.until_heard(f"alarm/node-{LOAD_CELL}", active=True)
    await rig.until_snapshots(5, only_wheel_3_lacks, "wheel 3 lacking")


async def identity(rig: Rig) -> None:
    """Another product is not configured, and not believed."""
    rig.tell(f"identity {LOAD_CELL} product 0x999", f"reset {LOAD_CELL}")
    await boot_failed(rig, "wrong-product")


async def silent(rig: Rig) -> None:
    """Heartbeat goes on: the node is operational, its value is not there, and health counts what is missing."""
    rig.tell(f"silent {LOAD_CELL}")
    await rig.until_snapshots(5, only_wheel_3_lacks, "wheel 3 lacking")
    await rig.until(lambda: _grows(rig, "missing"), "more and more missing readings in `health`")
    assert not rig.since(f"node/{LOAD_CELL}")


async def frozen(rig: Rig) -> None:
    """The same value again and again while the rover drives: it is published as it is, and an alarm says so."""
    network = await rig.service.opened()
    await network.enable()
    await network.set_speed((0.29,) * 6)
    rig.tell(f"frozen {LOAD_CELL}")
    alarm = await rig.until_heard("alarm/sensor", active=True)
    assert f"load_N of wheel {WHEEL}:" in alarm["text"]
    await rig.until_snapshots(8, lambda snapshot: all(snapshot["measured"]), "all wheels measured")
    latest = rig.since("snapshot")[-8:]
    assert len({snapshot["load_N"][WHEEL - 1] for snapshot in latest}) == 1
    assert all(len({snapshot["load_N"][wheel] for snapshot in latest}) > 1 for wheel in (0, 1, 3, 4, 5))
    rig.tell(f"clear {LOAD_CELL}")
    await rig.until_heard("alarm/sensor", active=False)
    await network.disable()


async def deaf(rig: Rig) -> None:
    """A drive that ignores PDOs turns on while the others slow down, and its speed says so; a quick stop reaches it."""
    network = await rig.service.opened()
    await network.enable()
    await network.set_speed((0.29,) * 6)
    await rig.until_snapshots(3, lambda snapshot: min(snapshot["motor_speed_rad_s"]) > 400, "all wheels turning")
    rig.tell(f"deaf {DRIVE}")
    await network.set_speed((0.1,) * 6)
    await rig.until_snapshots(
        3,
        lambda snapshot: [speed > 200 for speed in snapshot["motor_speed_rad_s"]] == [w == DRIVE for w in range(1, 7)],
        "one wheel too fast",
    )
    await network.quick_stop()
    await rig.until_snapshots(3, lambda snapshot: not any(snapshot["motor_speed_rad_s"]), "all wheels standing")
    await rig.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")
    await network.disable()


async def slow(rig: Rig) -> None:
    """An answer after the synchronous window is no answer; health counts what is late."""
    rig.tell(f"slow {LOAD_CELL} 96")
    await rig.until_snapshots(5, only_wheel_3_lacks, "wheel 3 lacking")
    await rig.until(lambda: _grows(rig, "late"), "more and more late readings in `health`")


async def short(rig: Rig) -> None:
    """A PDO that is not as long as its mapping gives no value."""
    rig.tell(f"short {LOAD_CELL} 2")
    await rig.until_snapshots(5, only_wheel_3_lacks, "wheel 3 lacking")


async def status(rig: Rig) -> None:
    """A load cell that says `not valid` is believed."""
    rig.tell(f"status {LOAD_CELL} 1")
    await rig.until_snapshots(5, only_wheel_3_lacks, "wheel 3 lacking")


async def no_boot_up(rig: Rig) -> None:
    """Silent after the reset."""
    rig.tell(f"no-boot-up {LOAD_CELL}", f"reset {LOAD_CELL}")
    await boot_failed(rig, "no-boot-up")


async def no_heartbeat(rig: Rig) -> None:
    """Lost, and not booted while it stays so."""
    rig.tell(f"no-heartbeat {LOAD_CELL}")
    await rig.until_heard("event", kind="node-lost", node_id=LOAD_CELL)
    await boot_failed(rig, "no-heartbeat")


async def no_sdo(rig: Rig) -> None:
    """It cannot be asked who it is."""
    rig.tell(f"no-sdo {LOAD_CELL}", f"reset {LOAD_CELL}")
    await boot_failed(rig, "no-sdo-answer")


async def refuse(rig: Rig) -> None:
    """It aborts what is written."""
    rig.tell(f"refuse {LOAD_CELL} 0x1017", f"reset {LOAD_CELL}")
    await boot_failed(rig, "configuration-refused")


async def forget(rig: Rig) -> None:
    """It answers what is written, and reads back something else."""
    rig.tell(f"forget {LOAD_CELL} 0x1017", f"reset {LOAD_CELL}")
    await boot_failed(rig, "configuration-not-kept")


async def clear(rig: Rig) -> None:
    """What is mended is there again, by itself."""
    rig.tell(f"silent {LOAD_CELL}")
    await rig.until_snapshots(5, only_wheel_3_lacks, "wheel 3 lacking")
    rig.tell(f"clear {LOAD_CELL}")
    await rig.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")


FAULTS = (
    *(off, on, reset, leave, emcy, fault, identity, silent, frozen, deaf, slow, short, status),
    *(no_boot_up, no_heartbeat, no_sdo, refuse, forget, clear),
)


def _grows(rig: Rig, count: str) -> bool:
    counts = [message["acquisition"][count] for message in rig.since("health")]
    return len(counts) >= 2 and counts[-1] > counts[0]


def test_every_command_of_the_rover_is_here() -> None:
    """Each that can be told is tested."""
    assert {each.__name__.replace("_", "-") for each in FAULTS} == set(COMMANDS)


@pytest.mark.asyncio(loop_scope="module")
@pytest.mark.parametrize("wrong", FAULTS, ids=lambda wrong: wrong.__name__)
async def test_what_is_published_and_that_the_rest_goes_on(well: Rig, wrong: Callable[[Rig], Any]) -> None:
    """See the function of the fault's name."""
    await wrong(well)
