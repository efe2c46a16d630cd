"""Every node on the bus in words: what it is, and what it would need in `rover.toml`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.canopen.emcy import error_text, register_bits
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.devices.registry import DEVICES
from regolithd.drivers.master.identity import compare_identity, unchecked
from regolithd.drivers.master.survey import Survey

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.drivers.devices.device import Device
    from regolithd.drivers.master.events import Identity
    from regolithd.drivers.master.survey import FoundNode

_MAXON = 0xFB
_EPOS4 = 0x01  # highest byte of 0x1018:03
_PROFILES = {
    401: ("input/output module", "load_cells", "cia401"),
    402: ("drive", "motors", "cia402"),
    404: ("measuring device", "load_cells", "cia404"),
    406: ("encoder", "", ""),
    410: ("inclinometer", "inclinometer", ""),
}
"""CiA device profiles: in words, their key in `[nodes]`, and the profile that fits any make."""


@dataclass(frozen=True, slots=True)
class ScannedNode:
    """One node; texts for people. `needs` says what to write into `rover.toml`, or what differs from it."""

    node_id: int
    device: str
    identity: str
    state: str
    errors: str
    needs: str


async def scan_bus(configuration: Configuration, *, known: bool) -> list[ScannedNode]:
    """Return every node on the bus of a configuration; `known`: compare them with its nodes.

    Raises
    ------
    BusError
        The bus cannot be used.
    """
    bus = configuration.bus
    async with open_bus(bus.interface, bus.channel, bitrate=bus.bitrate) as opened:
        found = await Survey(opened).run()
    nodes = {node.node_id: node for node in configuration.described()} if known else {}
    there = [describe(each, nodes.get(each.node_id), known=known) for each in found]
    silent = [
        ScannedNode(node_id, nodes[node_id].kind, "", "", "", "in [nodes], and neither answers nor sends")
        for node_id in nodes.keys() - {each.node_id for each in found}
    ]
    return sorted([*there, *silent], key=lambda each: each.node_id)


def describe(found: FoundNode, node: NodeDescription | None, *, known: bool) -> ScannedNode:
    """Return a found node in words; `node` is the configured one with its node-ID, `known` whether there are any."""
    kind, _, _ = _PROFILES.get(found.profile_number or 0, ("", "", ""))
    number = "" if found.profile_number is None else f"CiA {found.profile_number}"
    state = "no heartbeat" if found.nmt_state is None else found.nmt_state.text
    return ScannedNode(
        found.node_id,
        " ".join(filter(None, (found.name, kind, number))) or "does not answer SDO",
        _identity(found.identity),
        state,
        _errors(found),
        _needs(found, node, known=known),
    )


def _identity(identity: Identity | None) -> str:
    if identity is None:
        return ""
    return (
        f"vendor 0x{identity.vendor:X}, product 0x{identity.product:08X}, revision 0x{identity.revision:08X}, "
        f"serial 0x{identity.serial:X}"
    )


def _errors(found: FoundNode) -> str:
    register = ", ".join(register_bits(found.error_register)) if found.error_register else ""
    history = "; ".join(f"0x{code:04X} {error_text(code)}" for code in found.errors)
    return " – ".join(filter(None, (register, history)))


def _needs(found: FoundNode, node: NodeDescription | None, *, known: bool) -> str:
    if found.identity is None:
        return "It sends, and does not answer: reset it, or look for a second node with its id"
    if found.shared:
        return "Two nodes answer with this id: switch one off, and give it another"
    if node is not None:
        difference = compare_identity(node, found.identity)
        return "as configured" if difference is None else difference[1]
    absent = "not in [nodes]. " if known else ""
    if own := _expected_without_devices(found):
        return f"{absent}It would need its id in [nodes] {own.configuration_key}"
    _, key, profile = _PROFILES.get(found.profile_number or 0, ("", "", ""))
    if not key:
        return f"{absent}No profile of regolithd fits: describe its objects in [devices.{found.node_id}]"
    chosen = _own_profile(found.identity) or profile
    of_profile = f' and [devices.{found.node_id}] profile = "{chosen}"' if chosen else ""
    return f"{absent}It would need its id in [nodes] {key}{of_profile}"


def _expected_without_devices(found: FoundNode) -> Device | None:
    """Return the device that comes with regolithd and has this identity: it needs no `[devices]`."""
    return next(
        (
            device
            for device in DEVICES
            if found.identity is not None
            and not unchecked(device)
            and compare_identity(NodeDescription(found.node_id, device, None), found.identity) is None
        ),
        None,
    )


def _own_profile(identity: Identity) -> str:
    """Return the profile of a maker's own, where there is one."""
    if identity.vendor != _MAXON or identity.device_type & 0xFFFF != 402:
        return ""
    return "epos4" if identity.revision >> 24 == _EPOS4 else "epos2"
