"""Checks the CAN bus and its nodes: link, bit rate, bus load, and which nodes answer."""

from __future__ import annotations

import asyncio
import json
from collections import Counter
from typing import TYPE_CHECKING, Any

from regolithd.daemon.check.finding import Finding, good, unknown, warning, wrong
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.can.socketcan import CAN_LINK_TYPE, NETWORK_LINKS
from regolithd.drivers.errors import BusError
from regolithd.drivers.master.bus_load import bus_load
from regolithd.drivers.master.scan import scan

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.daemon.config.configuration import Bus, Configuration
    from regolithd.daemon.control.protocol import Status
    from regolithd.drivers.master.scan import ScanResult

_LINKS = NETWORK_LINKS
_UP = 0x1  # IFF_UP
_HIGH_LOAD = 0.8  # bus load above which frames of low priority are delayed


CONFIGURATION_REMEDY = (
    "It cannot be booted like this: name the EDS of this firmware in [devices], state other objects or units there, or "
    "set the value with the maker's program."
)


async def check_bus(configuration: Configuration, running: Status | None) -> list[Finding]:
    """Check the link; then probe every node, or ask the running daemon for their states."""
    bus = configuration.bus
    if bus.interface == "virtual":
        return [unknown("bus", "an interface inside one process ([bus] interface): there are no nodes to probe")]
    link = check_link(bus, await _details(bus.channel)) if bus.interface == "socketcan" else []
    if any(finding.verdict == "wrong" for finding in link):
        return [*link, unknown("nodes", "they cannot be probed without the bus")]
    load = check_load(configuration)
    if running is not None:
        return [*link, *load, *nodes_of_daemon(running)]
    try:
        async with open_bus(bus.interface, bus.channel, bitrate=bus.bitrate) as opened:
            found = await scan(opened, configuration.described())
    except BusError as error:
        return [
            *link,
            wrong("bus", error.what, error.remedy),
            unknown("nodes", "they cannot be probed without the bus"),
        ]
    return [*(link or [good("bus", f"{bus.interface} {bus.channel} is open")]), *load, *judge_nodes(found)]


def check_link(bus: Bus, details: dict[str, Any]) -> list[Finding]:
    """Check the kernel's CAN link: present, of type CAN, up."""
    folder = _LINKS / bus.channel
    up = f"`sudo ip link set {bus.channel} up type can bitrate {bus.bitrate}`, or regolithd-can@{bus.channel}.service."
    if not folder.exists():
        there = [each.name for each in sorted(_LINKS.glob("*")) if _text(each / "type") == CAN_LINK_TYPE]
        others = f"there are {', '.join(there)}" if there else "there is no CAN link at all"
        remedy = "Plug in the CAN adapter and load its module, or correct [bus] channel."
        return [wrong("bus", f"there is no link {bus.channel!r}; {others}", remedy)]
    if _text(folder / "type") != CAN_LINK_TYPE:
        return [wrong("bus", f"{bus.channel!r} is no CAN link", "Correct [bus] channel.")]
    if not int(_text(folder / "flags") or "0", 16) & _UP:
        return [wrong("bus", f"{bus.channel} is down", up)]
    return [judge_link(bus, details)]


def check_load(configuration: Configuration) -> list[Finding]:
    """Compute the bus load; return a finding only if it is too high."""
    rate_Hz, bitrate = configuration.sync.rate_Hz, configuration.bus.bitrate
    heartbeat_s = configuration.nodes.heartbeat_ms / 1000
    share = bus_load(
        configuration.described(),
        sync_rate_Hz=rate_Hz,
        bitrate=bitrate,
        node_heartbeat_s=heartbeat_s,
        master_heartbeat_s=heartbeat_s / 2,
    )
    if share <= _HIGH_LOAD:
        return []
    text = f"at {rate_Hz:g} Hz its frames take up to {share:.0%} of {bitrate} bit/s"
    remedy = "Lower [sync] rate_Hz, or raise the bit rate of all nodes and [bus] bitrate."
    return [(warning if share <= 1.0 else wrong)("bus load", text, remedy)]


def judge_link(bus: Bus, details: dict[str, Any]) -> Finding:
    """Judge a link that is up from iproute2's details: bit rate, error state."""
    kind = details.get("linkinfo", {})
    data = kind.get("info_data", {})
    bitrate = data.get("bittiming", {}).get("bitrate")
    state = str(data.get("state", "")).lower()
    if bitrate is not None and bitrate != bus.bitrate:
        text = f"{bus.channel} runs at {bitrate} bit/s, [bus] bitrate says {bus.bitrate}"
        remedy = f"`sudo ip link set {bus.channel} down`, then up with the right one; or correct [bus] bitrate."
        return wrong("bus", text, remedy)
    if state in {"bus-off", "error-passive", "error-warning"}:
        remedy = "Check cable, termination (120 Ω at both ends), bit rate, and that another node is on the bus."
        return (wrong if state == "bus-off" else warning)("bus", f"{bus.channel} is in state {state}", remedy)
    speed = f"{bitrate} bit/s" if bitrate else f"a {kind.get('info_kind', 'CAN')} link, which has no bit rate"
    return good("bus", f"{bus.channel} is up: {speed}{', ' + state if state else ''}")


async def _details(channel: str) -> dict[str, Any]:
    """Return the output of `ip -details -json link show`; empty where iproute2 is not installed."""
    try:
        process = await asyncio.create_subprocess_exec(
            "ip", "-details", "-json", "link", "show", channel, stdout=-1, stderr=-1
        )
        out, _ = await process.communicate()
        found = json.loads(out)
    except (OSError, ValueError):
        return {}
    return found[0] if isinstance(found, list) and found and isinstance(found[0], dict) else {}


def _text(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""


def judge_nodes(found: list[ScanResult]) -> list[Finding]:
    """Return a finding for each node with a problem, and one for all the others."""
    lines = [
        (wrong if each.node.required else warning)(
            f"node {each.node.node_id}", f"{each.node.kind}: {each.problem}", each.remedy
        )
        for each in found
        if each.problem
    ]
    for each in found:
        lines += [
            (wrong if each.node.required else warning)(f"node {each.node.node_id}", text, CONFIGURATION_REMEDY)
            for text in each.differences
        ]
    lines += _reservations(found)
    well = Counter(each.node.kind for each in found if not each.problem)
    if well:
        kinds = ", ".join(f"{count} {kind}" for kind, count in well.items())
        lines.insert(0, good("nodes", f"{well.total()} of {len(found)} answer with the expected identity: {kinds}"))
    return lines


def _reservations(found: list[ScanResult]) -> list[Finding]:
    """Return one warning for each thing that cannot be checked, with the nodes that it concerns."""
    nodes: dict[str, list[int]] = {}
    for each in found:
        if each.reservations:
            nodes.setdefault(each.reservations.removeprefix("; "), []).append(each.node.node_id)
    remedy = "What is not checked can be stated in [devices], so that another device is noticed."
    return [
        warning(f"node{'s' * (len(ids) > 1)} {', '.join(map(str, ids))}", text, remedy) for text, ids in nodes.items()
    ]


def nodes_of_daemon(status: Status) -> list[Finding]:
    """Return the same from the status of the running daemon, which uses the bus."""
    lines = [
        wrong(f"node {node.node_id}", f"{node.kind}: {node.text or node.phase}", "`regolithd status` shows it live.")
        for node in status.nodes
        if node.phase != "operational"
    ]
    count = len(status.nodes) - len(lines)
    if count:
        lines.insert(0, good("nodes", f"{count} of {len(status.nodes)} are operational, says the running daemon"))
    if not status.nodes:
        lines.append(wrong("nodes", f"the running daemon has none: bus {status.bus}", "See its journal."))
    return lines
