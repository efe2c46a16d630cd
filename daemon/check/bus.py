"""The bus and its nodes: whether there is a link, up, at the right bit rate and not overfull, and who answers."""

from __future__ import annotations

import asyncio
import json
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from regolithd.daemon.check.finding import Finding, good, unknown, warning, wrong
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.errors import BusError
from regolithd.drivers.master.bus_load import bus_load
from regolithd.drivers.master.scan import probe

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Bus, Configuration
    from regolithd.daemon.control.protocol import Status
    from regolithd.drivers.master.scan import Probe

CAN_LINK = "280"  # ARPHRD_CAN, if_arp.h
_LINKS = Path("/sys/class/net")
_UP = 0x1  # IFF_UP
_CROWDED = 0.8  # above it, frames of low priority come late


async def check_bus(configuration: Configuration, running: Status | None) -> list[Finding]:
    """Look at the link; then ask every node, or the running daemon, who already has."""
    bus = configuration.bus
    if bus.interface == "virtual":
        return [unknown("bus", "in this process alone ([bus] interface): there is nobody to ask")]
    link = check_link(bus, await _details(bus.channel)) if bus.interface == "socketcan" else []
    if any(finding.verdict == "wrong" for finding in link):
        return [*link, unknown("nodes", "they cannot be asked without the bus")]
    load = check_load(configuration)
    if running is not None:
        return [*link, *load, *nodes_of_daemon(running)]
    try:
        async with open_bus(bus.interface, bus.channel, bitrate=bus.bitrate) as opened:
            found = await probe(opened, configuration.nodes.described())
    except BusError as error:
        return [*link, wrong("bus", error.what, error.cure), unknown("nodes", "they cannot be asked without the bus")]
    return [*(link or [good("bus", f"{bus.interface} {bus.channel} is open")]), *load, *judge_nodes(found)]


def check_link(bus: Bus, details: dict[str, Any]) -> list[Finding]:
    """Look at the kernel's CAN link."""
    folder = _LINKS / bus.channel
    up = f"`sudo ip link set {bus.channel} up type can bitrate {bus.bitrate}`, or regolithd-can@{bus.channel}.service."
    if not folder.exists():
        there = [each.name for each in sorted(_LINKS.glob("*")) if _text(each / "type") == CAN_LINK]
        others = f"there are {', '.join(there)}" if there else "there is no CAN link at all"
        cure = "Is the adapter plugged in and its module loaded? Else mend [bus] channel."
        return [wrong("bus", f"there is no link {bus.channel!r}; {others}", cure)]
    if _text(folder / "type") != CAN_LINK:
        return [wrong("bus", f"{bus.channel!r} is no CAN link", "Mend [bus] channel.")]
    if not int(_text(folder / "flags") or "0", 16) & _UP:
        return [wrong("bus", f"{bus.channel} is down", up)]
    return [judge_link(bus, details)]


def check_load(configuration: Configuration) -> list[Finding]:
    """Compute how full the bus will be; say nothing where there is room."""
    rate_Hz, bitrate = configuration.sync.rate_Hz, configuration.bus.bitrate
    heartbeat_s = configuration.nodes.heartbeat_ms / 1000
    share = bus_load(
        configuration.nodes.described(),
        sync_rate_Hz=rate_Hz,
        bitrate=bitrate,
        node_heartbeat_s=heartbeat_s,
        master_heartbeat_s=heartbeat_s / 2,
    )
    if share <= _CROWDED:
        return []
    text = f"at {rate_Hz:g} Hz its frames take up to {share:.0%} of {bitrate} bit/s"
    cure = "Lower [sync] rate_Hz, or raise the bit rate of all nodes and [bus] bitrate."
    return [(warning if share <= 1.0 else wrong)("bus load", text, cure)]


def judge_link(bus: Bus, details: dict[str, Any]) -> Finding:
    """Return what iproute2 says of a link that is up: bit rate, error state."""
    kind = details.get("linkinfo", {})
    data = kind.get("info_data", {})
    bitrate = data.get("bittiming", {}).get("bitrate")
    state = str(data.get("state", "")).lower()
    if bitrate is not None and bitrate != bus.bitrate:
        text = f"{bus.channel} runs at {bitrate} bit/s, [bus] bitrate says {bus.bitrate}"
        cure = f"`sudo ip link set {bus.channel} down`, then up with the right one; or mend [bus] bitrate."
        return wrong("bus", text, cure)
    if state in {"bus-off", "error-passive", "error-warning"}:
        cure = "Cable, termination (120 Ω at both ends), bit rate; nobody else on the bus?"
        return (wrong if state == "bus-off" else warning)("bus", f"{bus.channel} is in state {state}", cure)
    speed = f"{bitrate} bit/s" if bitrate else f"a {kind.get('info_kind', 'CAN')} link, which has no bit rate"
    return good("bus", f"{bus.channel} is up: {speed}{', ' + state if state else ''}")


async def _details(channel: str) -> dict[str, Any]:
    """Return what `ip -details` knows; nothing where it is not installed."""
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


def judge_nodes(found: list[Probe]) -> list[Finding]:
    """Return a line for each node that is not as it should be, and one for all that are."""
    lines = [
        (wrong if each.node.required else warning)(
            f"node {each.node.node_id}", f"{each.node.kind}: {each.problem}", each.cure
        )
        for each in found
        if each.problem
    ]
    well = Counter(each.node.kind for each in found if not each.problem)
    if well:
        kinds = ", ".join(f"{count} {kind}" for kind, count in well.items())
        lines.insert(0, good("nodes", f"{well.total()} of {len(found)} answer and are who they should be: {kinds}"))
    return lines


def nodes_of_daemon(status: Status) -> list[Finding]:
    """Return the same, as the running daemon says it: the bus is its own."""
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
