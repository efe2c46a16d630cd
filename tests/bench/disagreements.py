"""Deliberate disagreements between configuration, EDS file, device and bus, and the message that one sees of each.

    python tests/bench/disagreements.py > docs/reference/disagreements.md

Three kinds: in `rover.toml` (what `regolithd check --syntax` prints), at boot (the event and alarm of the node), and
while the daemon runs (alarms). Virtual nodes on an in-process bus; a test holds the page to what they say.
"""

from __future__ import annotations

import asyncio
import itertools
import sys
import tempfile
from contextlib import AsyncExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from regolithd.daemon.config.reader import ConfigurationError, parse_configuration
from regolithd.daemon.health.alarms import AlarmInputs, current_alarms
from regolithd.daemon.pipeline.acquire import Acquisition
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.devices.decoding.signals import Reading, Sync
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.master.events import NodeBooted, NodeBootFailed
from regolithd.drivers.master.network import Network, NetworkSettings
from regolithd.drivers.virtual.plant import Bench
from regolithd.drivers.virtual.rover import VirtualRover

ROVER = Path("rover.toml")
CHANNELS = itertools.count()
PERIOD_NS = 50_000_000
TIMEOUT_S = 20.0

IN_THE_FILE = (
    ("a unit of another quantity", '[devices.motors.objects]\nmotor_current_A = {unit = "N"}'),
    ("an absurd scale", "[devices.motors.objects]\nmotor_speed_rad_s = {scale = 1e6}"),
    ("the EDS file of another drive", f'[devices.motors]\neds = "{EDS_FOLDER}/epos4.eds"'),
    ("a profile that there is not", '[devices.motors]\nprofile = "epos5"'),
    ("an EDS file that is not there", '[devices.motors]\neds = "absent.eds"'),
    ("a file that is no EDS", '[devices.motors]\neds = "rover.toml.txt"'),
    ("an analogue input without scale", '[devices.load_cells]\nprofile = "cia401"'),
    ("an object that may not be mapped", '[devices.motors.objects]\nmotor_current_A = {object = "0x6083"}'),
    ("a setting out of its type's range", '[devices.motors.settings]\n"0x605A" = 99999'),
    ("one node-ID for two nodes", "[nodes]\nload_cells = [1, 12, 13, 14, 15, 16]"),
)


@dataclass(frozen=True)
class AtBoot:
    """A device that differs from its description: objects with another power-on value, or fault commands."""

    name: str
    objects: tuple[tuple[tuple[int, int], int], ...] = ()
    faults: tuple[str, ...] = ()
    table: str = (
        '[devices.3]\nprofile = "cia402"\nvendor = 0x9A\nproduct = 7\nrevisions = [0x10000, 0x2FFFF]\nserial = 3'
    )


AT_BOOT = (
    AtBoot("another kind of device", (((0x1000, 0), 0x0002_0194),)),
    AtBoot("another maker", faults=("identity 3 vendor 0xFB",)),
    AtBoot("another product", faults=("identity 3 product 8",)),
    AtBoot("firmware outside the range", faults=("identity 3 revision 0x30000",)),
    AtBoot("an exchanged device", faults=("identity 3 serial 4",)),
    AtBoot("a read-only object with another value", (((0x1005, 0), 0x90),), table='[devices.3]\nprofile = "epos4"'),
    AtBoot("an object that cannot be written", faults=("refuse 3 0x1017",)),
    AtBoot("a value that the device does not keep", faults=("forget 3 0x1017",)),
    AtBoot("a rated current that was never set", (((0x6075, 0), 0),)),
    AtBoot("a speed in a unit that is none", (((0x60A9, 0), 0x0021_0000),)),
    AtBoot("a speed in an absurd unit", (((0x60A9, 0), 0x05B4_4700),)),
    AtBoot("no boot-up in time", faults=("no-boot-up 3",)),
)


def in_the_file(text: str, folder: Path) -> str:
    """Return what is said about a configuration."""
    (folder / "rover.toml.txt").write_text("[rover]\n")
    try:
        parse_configuration(text + "\n", folder / ROVER)
    except ConfigurationError as error:
        return str(error).replace(f"{folder}/", "").replace(f"{EDS_FOLDER}/", "")
    raise AssertionError(f"nothing is said about {text}")


async def until(condition: object, what: str) -> None:
    """Wait until a condition holds."""
    async with asyncio.timeout(TIMEOUT_S):
        while not condition():  # type: ignore[operator]  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    del what


async def at_boot(case: AtBoot) -> str:
    """Return the text of the failed boot."""
    configuration = parse_configuration(case.table + "\n", ROVER)
    node = next(each for each in configuration.described() if each.node_id == 3)
    rover = VirtualRover(Bench(), [node])
    dictionary = rover.nodes[3].dictionary
    changed = {key: replace(dictionary.entries[key], default=value) for key, value in case.objects}
    dictionary.entries = {**dictionary.entries, **changed}
    for line in case.faults:
        assert rover.inject_fault(line) == "ok", line
    events: list[object] = []
    settings = NetworkSettings((node,), sync_rate_Hz=20.0, boot_up_timeout_s=0.4, sdo_timeout_s=0.4)
    channel = f"disagreement-{next(CHANNELS)}"
    async with AsyncExitStack() as stack:
        buses = [await stack.enter_async_context(open_bus("virtual", channel)) for _ in range(2)]
        tasks = await stack.enter_async_context(asyncio.TaskGroup())
        serving = tasks.create_task(rover.run(buses[0]))
        await asyncio.sleep(0)
        if (0x1000, 0) in changed:
            rover.nodes[3].dictionary.values[0x1000, 0] = dict(case.objects)[0x1000, 0]
            rover.nodes[3]._identify = lambda: None  # type: ignore[method-assign]  # it would set the expected type
        network = tasks.create_task(Network(buses[1], settings, on_event=events.append).run())
        await until(lambda: [each for each in events if isinstance(each, NodeBootFailed | NodeBooted)], case.name)
        network.cancel()
        await asyncio.wait([network])
        serving.cancel()
    failed = next(each for each in events if isinstance(each, NodeBootFailed | NodeBooted))
    assert isinstance(failed, NodeBootFailed), case.name
    return failed.text


def while_running() -> list[tuple[str, str]]:
    """Return the alarms of intruders."""
    from regolithd.drivers.master.intruders import IntruderWatch  # noqa: PLC0415

    node = next(each for each in parse_configuration("", ROVER).described() if each.node_id == 11)
    taken = Acquisition([node], [0x18B], PERIOD_NS)
    for k in range(4):
        taken.accept(Sync(k * PERIOD_NS, sent=True))
        for _ in range(2):
            taken.accept(Reading(k * PERIOD_NS + 1000, 11, 0x18B, ()))
    found = [("two nodes with one node-ID", AlarmInputs(shared_node_ids=taken.shared_node_ids))]
    for name, frame in (
        ("a second SYNC producer", Frame(1, 0x080, b"")),
        ("a second master", Frame(1, 0x000, b"\x81\0")),
        ("a second daemon", Frame(1, 0x77F, b"\5")),
        ("a node that nobody expects", Frame(1, 0x72C, b"\5")),
    ):
        watch = IntruderWatch([11], master_id=127)
        watch.take(frame)
        found.append((name, AlarmInputs(intruders=watch.present(2))))
    return [
        (name, f"{alarm.name} ({alarm.severity.value}): {alarm.text}. {alarm.remedy}")
        for name, inputs in found
        for alarm in current_alarms(inputs).values()
    ]


async def page() -> str:
    """Return the page."""
    with tempfile.TemporaryDirectory() as folder:
        file = [(name, in_the_file(text, Path(folder))) for name, text in IN_THE_FILE]
    boot = [(case.name, await at_boot(case)) for case in AT_BOOT]
    head = (
        "# What one sees when something disagrees\n\n"
        "<!-- Written by `python tests/bench/disagreements.py`; a test holds it to the code. -->\n\n"
        "Configuration, EDS file, device and bus, made to disagree on purpose, and the message of each."
    )
    parts = [head]
    for title, rows in (
        ("In `rover.toml`: `regolithd check --syntax`, exit status 78", file),
        ("At boot: event `node-boot-failed`, alarm `node-3`", boot),
        ("While the daemon runs: alarms", while_running()),
    ):
        lines = [f"| {name} | {message.replace('|', '∣')} |" for name, message in rows]
        parts.append("\n".join([f"## {title}\n", "| disagreement | message |", "|---|---|", *lines]))
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    sys.stdout.write(asyncio.run(page()))
