"""Each fault of the virtual rover: what is published of it, and that everything else goes on.

One daemon with a mosquitto broker runs through all tests, on an in-process bus. Load cell 13 (wheel 3) and drive 2
fail. Every fault-injection command is in `FAULTS`; a new one without an entry fails here.
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
from regolithd.daemon.wiring import connect_sinks, open_stores
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.virtual import VirtualRover
from regolithd.drivers.virtual.fault_injection import COMMANDS

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Iterator

pytestmark = pytest.mark.timeout(180)

RATE_HZ = 10.0
TIMEOUT_S = 60.0
LOAD_CELL, WHEEL = 13, 3
DRIVE = 2
ROOT = "regolith/kapvik"


@dataclass
class Rig:
    """A running daemon, its virtual rover, and all received messages as (topic, message)."""

    rover: VirtualRover
    service: Service
    received: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    mark: int = 0

    def inject(self, *commands: str) -> None:
        """Inject faults; `since` and `until_received` consider messages from now on."""
        self.mark = len(self.received)
        for command in commands:
            assert self.rover.inject_fault(command) == "ok", command

    def since(self, topic: str, **fields: object) -> list[dict[str, Any]]:
        """Return the messages of a topic since the last injection that have these values."""
        return [
            message
            for at, message in self.received[self.mark :]
            if at == f"{ROOT}/{topic}" and all(message[name] == value for name, value in fields.items())
        ]

    async def until(self, condition: Callable[[], object], what: str) -> None:
        """Wait until a condition holds; fail after TIMEOUT_S with the latest messages."""
        end = time.monotonic() + TIMEOUT_S
        while not condition():
            if time.monotonic() > end:
                latest = [
                    f"{at}: {message}" for at, message in self.received[self.mark :] if "event" in at or "node" in at
                ]
                pytest.fail(f"not received within {TIMEOUT_S:g} s: {what}\n" + "\n".join(latest[-20:]))
            await asyncio.sleep(0.05)

    async def until_received(self, topic: str, **fields: object) -> dict[str, Any]:
        """Wait for a message with these values and return it."""
        await self.until(lambda: self.since(topic, **fields), f"{topic} {fields}")
        return self.since(topic, **fields)[0]

    async def until_snapshots(self, count: int, condition: Callable[[dict[str, Any]], bool], what: str) -> None:
        """Wait until the last `count` snapshots all meet a condition."""

        def met() -> bool:
            latest = self.since("snapshot")[-count:]
            return len(latest) == count and all(condition(snapshot) for snapshot in latest)

        await self.until(met, f"{count} snapshots in a row with {what}")

    async def until_operational(self) -> None:
        """Wait until every node is operational and every wheel measured."""
        network = await self.service.opened()
        await self.until(lambda: {s.phase.value for s in network.status.values()} == {"operational"}, "all operational")
        await self.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")


async def receive(rig: Rig, port: int) -> None:
    """Subscribe to all messages and keep them."""
    async with aiomqtt.Client("127.0.0.1", port, identifier="faults") as client:
        await client.subscribe(f"{ROOT}/#", qos=1)
        async for message in client.messages:
            assert isinstance(message.payload, bytes)
            rig.received.append((str(message.topic), json.loads(message.payload)))


async def run(rig: Rig, port: int, ended: asyncio.Event) -> None:
    """Run rover, daemon and subscriber until `ended` is set."""
    async with open_bus("virtual", "faults") as bus, asyncio.TaskGroup() as tasks:
        background = [tasks.create_task(rig.rover.run(bus)), tasks.create_task(receive(rig, port))]
        running = tasks.create_task(rig.service.run())
        await ended.wait()
        running.cancel()
        await asyncio.wait([running])
        for task in background:
            task.cancel()


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mosquitto]:
    """One broker for all tests of this module."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    running = Mosquitto(tmp_path_factory.mktemp("mosquitto"))
    running.start()
    yield running
    running.stop()


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def daemon(broker: Mosquitto, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Rig]:
    """One daemon for all tests of this module, with all sinks that it has on a rover."""
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
    connect_sinks(service, open_stores(service.configuration.mqtt))
    rig, ended = Rig(VirtualRover(VirtualWorld()), service), asyncio.Event()
    # One task owns all contexts: pytest begins and ends a fixture in two different ones.
    running = asyncio.ensure_future(run(rig, broker.port, ended))
    yield rig
    ended.set()
    await running


@pytest_asyncio.fixture(loop_scope="module")
async def operational(daemon: Rig) -> AsyncIterator[Rig]:
    """The daemon with all nodes operational; afterwards all faults are cleared, and no snapshot may be missing."""
    await daemon.until_operational()
    yield daemon
    daemon.inject("clear all", "on all")
    if any(status.phase.value != "operational" for status in (await daemon.service.opened()).status.values()):
        daemon.inject(f"reset {LOAD_CELL}")
    await daemon.until_operational()
    received = [message["sequence"] for topic, message in daemon.received if topic == f"{ROOT}/snapshot"]
    assert received == list(
        range(received[0], received[0] + len(received))
    )  # one snapshot for each SYNC, in spite of the fault


def only_wheel_3_is_missing(snapshot: dict[str, Any]) -> bool:
    """Return whether wheel 3's load is null and not measured, and all other readings are present."""
    others = [measured for wheel, measured in enumerate(snapshot["measured"], start=1) if wheel != WHEEL]
    lacks = snapshot["load_N"][WHEEL - 1] is None and not snapshot["measured"][WHEEL - 1]
    return lacks and all(others) and None not in snapshot["motor_current_A"] and snapshot["pitch_rad"] is not None


def all_faster(snapshot: dict[str, Any], speed_rad_s: float) -> bool:
    """Return whether all motors were measured and turn faster; on a busy computer an answer may be late, so null."""
    return all(speed is not None and speed > speed_rad_s for speed in snapshot["motor_speed_rad_s"])


def only_drive_2_is_fast(snapshot: dict[str, Any]) -> bool:
    """Return whether all motors were measured and only drive 2 turns faster than 200 rad/s."""
    speeds = snapshot["motor_speed_rad_s"]
    return None not in speeds and [speed > 200 for speed in speeds] == [drive == DRIVE for drive in range(1, 7)]


# Each function has the name of a fault: it injects the fault and awaits what must be published.


async def lost_node(rig: Rig) -> None:
    """Event, node and alarm are published; the wheel has no load, all others go on."""
    await rig.until_received("event", kind="node-lost", node_id=LOAD_CELL)
    await rig.until_received(f"node/{LOAD_CELL}", phase="lost")
    alarm = await rig.until_received(f"alarm/node-{LOAD_CELL}", active=True)
    assert alarm["severity"] == "error"
    assert alarm["text"]
    assert alarm["remedy"]
    await rig.until_snapshots(5, only_wheel_3_is_missing, "no load of wheel 3")


async def off(rig: Rig) -> None:
    """A node without power is lost."""
    rig.inject(f"off {LOAD_CELL}")
    await lost_node(rig)


async def on(rig: Rig) -> None:
    """A node whose power returns is booted, its alarm ends and its readings return."""
    rig.inject(f"off {LOAD_CELL}")
    await lost_node(rig)
    rig.inject(f"on {LOAD_CELL}")
    await rig.until_received("event", kind="node-booted", node_id=LOAD_CELL)
    await rig.until_received(f"alarm/node-{LOAD_CELL}", active=False)
    await rig.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")


async def reset(rig: Rig) -> None:
    """A restart of a node is a loss and a boot."""
    rig.inject(f"reset {LOAD_CELL}")
    await rig.until_received("event", kind="node-lost", node_id=LOAD_CELL)
    await rig.until_received("event", kind="node-booted", node_id=LOAD_CELL)


async def leave(rig: Rig) -> None:
    """A node that leaves state operational is lost and booted again."""
    rig.inject(f"leave {LOAD_CELL}")
    await rig.until_received("event", kind="node-lost", node_id=LOAD_CELL)
    await rig.until_received("event", kind="node-booted", node_id=LOAD_CELL)


async def emcy(rig: Rig) -> None:
    """An EMCY is published with its text when it begins and when it ends; readings go on."""
    rig.inject(f"emcy {LOAD_CELL} 0x5000")
    begun = await rig.until_received("emcy", node_id=LOAD_CELL, code="0x5000", cleared=False)
    assert begun["wheel"] == WHEEL
    assert "hardware" in begun["text"].lower()
    rig.inject(f"emcy {LOAD_CELL} 0")
    await rig.until_received("emcy", node_id=LOAD_CELL, cleared=True)
    await rig.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")


async def fault(rig: Rig) -> None:
    """A drive fault while driving: EMCY and drive state are published, all others stop, readings go on."""
    network = await rig.service.opened()
    await network.enable()
    await network.set_speed((0.29,) * 6)
    await rig.until_snapshots(3, lambda snapshot: all_faster(snapshot, 100), "all wheels turning")
    rig.inject(f"fault {DRIVE} 0x2310")
    await rig.until_received("emcy", node_id=DRIVE, code="0x2310")
    await rig.until_received("event", kind="drive-state-changed", node_id=DRIVE)
    await rig.until_received("event", kind="motion-stopped")
    await rig.until_snapshots(3, lambda snapshot: not any(snapshot["motor_speed_rad_s"]), "all wheels standing")
    await rig.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")
    await network.enable()  # resets the fault
    await network.disable()


async def boot_failed(rig: Rig, reason: str) -> None:
    """Event, node with reason, and alarm are published; the wheel has no load, all others go on."""
    await rig.until_received("event", kind="node-boot-failed", node_id=LOAD_CELL)
    node = await rig.until_received(f"node/{LOAD_CELL}", phase="failed", reason=reason)
    assert f"node {LOAD_CELL}" in node["text"]
    await rig.until_received(f"alarm/node-{LOAD_CELL}", active=True)
    await rig.until_snapshots(5, only_wheel_3_is_missing, "no load of wheel 3")


async def identity(rig: Rig) -> None:
    """A node with another product code is not configured, and its readings are not used."""
    rig.inject(f"identity {LOAD_CELL} product 0x999", f"reset {LOAD_CELL}")
    await boot_failed(rig, "wrong-product")


async def silent(rig: Rig) -> None:
    """A node with heartbeat but without PDOs stays operational; its readings are counted as missing."""
    rig.inject(f"silent {LOAD_CELL}")
    await rig.until_snapshots(5, only_wheel_3_is_missing, "no load of wheel 3")
    await rig.until(lambda: _grows(rig, "missing"), "more and more missing readings in `health`")
    assert not rig.since(f"node/{LOAD_CELL}")


async def frozen(rig: Rig) -> None:
    """A reading that does not change while driving is published, with an alarm for a stuck sensor."""
    network = await rig.service.opened()
    await network.enable()
    await network.set_speed((0.29,) * 6)
    rig.inject(f"frozen {LOAD_CELL}")
    alarm = await rig.until_received("alarm/sensor", active=True)
    assert f"load_N of wheel {WHEEL}:" in alarm["text"]
    await rig.until_snapshots(8, lambda snapshot: all(snapshot["measured"]), "all wheels measured")
    latest = rig.since("snapshot")[-8:]
    assert len({snapshot["load_N"][WHEEL - 1] for snapshot in latest}) == 1
    assert all(len({snapshot["load_N"][wheel] for snapshot in latest}) > 1 for wheel in (0, 1, 3, 4, 5))
    rig.inject(f"clear {LOAD_CELL}")
    await rig.until_received("alarm/sensor", active=False)
    await network.disable()


async def deaf(rig: Rig) -> None:
    """A drive that ignores PDOs keeps its speed while the others slow down; a quick stop stops it."""
    network = await rig.service.opened()
    await network.enable()
    await network.set_speed((0.29,) * 6)
    await rig.until_snapshots(3, lambda snapshot: all_faster(snapshot, 400), "all wheels turning")
    rig.inject(f"deaf {DRIVE}")
    await network.set_speed((0.1,) * 6)
    await rig.until_snapshots(
        3,
        only_drive_2_is_fast,
        "one wheel too fast",
    )
    await network.quick_stop()
    await rig.until_snapshots(3, lambda snapshot: not any(snapshot["motor_speed_rad_s"]), "all wheels standing")
    await rig.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")
    await network.disable()


async def slow(rig: Rig) -> None:
    """A PDO after the synchronous window is not used, and counted as late."""
    rig.inject(f"slow {LOAD_CELL} 96")
    await rig.until_snapshots(5, only_wheel_3_is_missing, "no load of wheel 3")
    await rig.until(lambda: _grows(rig, "late"), "more and more late readings in `health`")


async def short(rig: Rig) -> None:
    """A PDO that is shorter than its mapping gives no reading."""
    rig.inject(f"short {LOAD_CELL} 2")
    await rig.until_snapshots(5, only_wheel_3_is_missing, "no load of wheel 3")


async def status(rig: Rig) -> None:
    """A reading that the load cell marks as not valid is not used."""
    rig.inject(f"status {LOAD_CELL} 1")
    await rig.until_snapshots(5, only_wheel_3_is_missing, "no load of wheel 3")


async def no_boot_up(rig: Rig) -> None:
    """A node without boot-up message after a reset fails to boot."""
    rig.inject(f"no-boot-up {LOAD_CELL}", f"reset {LOAD_CELL}")
    await boot_failed(rig, "no-boot-up")


async def no_heartbeat(rig: Rig) -> None:
    """A node without heartbeat is lost, and fails to boot."""
    rig.inject(f"no-heartbeat {LOAD_CELL}")
    await rig.until_received("event", kind="node-lost", node_id=LOAD_CELL)
    await boot_failed(rig, "no-heartbeat")


async def no_sdo(rig: Rig) -> None:
    """A node that does not answer SDO requests fails to boot."""
    rig.inject(f"no-sdo {LOAD_CELL}", f"reset {LOAD_CELL}")
    await boot_failed(rig, "no-sdo-answer")


async def refuse(rig: Rig) -> None:
    """A node that aborts a download fails to boot."""
    rig.inject(f"refuse {LOAD_CELL} 0x1017", f"reset {LOAD_CELL}")
    await boot_failed(rig, "configuration-refused")


async def forget(rig: Rig) -> None:
    """A node that reads back another value than was written fails to boot."""
    rig.inject(f"forget {LOAD_CELL} 0x1017", f"reset {LOAD_CELL}")
    await boot_failed(rig, "configuration-not-kept")


async def clear(rig: Rig) -> None:
    """Readings return when the fault is cleared."""
    rig.inject(f"silent {LOAD_CELL}")
    await rig.until_snapshots(5, only_wheel_3_is_missing, "no load of wheel 3")
    rig.inject(f"clear {LOAD_CELL}")
    await rig.until_snapshots(5, lambda snapshot: all(snapshot["measured"]), "all wheels measured")


FAULTS = (
    *(off, on, reset, leave, emcy, fault, identity, silent, frozen, deaf, slow, short, status),
    *(no_boot_up, no_heartbeat, no_sdo, refuse, forget, clear),
)


def _grows(rig: Rig, count: str) -> bool:
    counts = [message["acquisition"][count] for message in rig.since("health")]
    return len(counts) >= 2 and counts[-1] > counts[0]


def test_every_fault_has_a_test() -> None:
    """Each fault-injection command is in `FAULTS`."""
    assert {each.__name__.replace("_", "-") for each in FAULTS} == set(COMMANDS)


@pytest.mark.asyncio(loop_scope="module")
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
async def test_a_fault_is_published_and_the_rest_goes_on(operational: Rig, fault: Callable[[Rig], Any]) -> None:
    """What the function with the fault's name describes holds."""
    await fault(operational)
