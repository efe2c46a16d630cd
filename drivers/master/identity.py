"""A node's identity (0x1000, 0x1018), and its comparison with the expected one (`devices.profiles.identity`).

What is not known is not compared; `unchecked` names it, so that this is never silent.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.drivers.devices.profiles.identity import ALL_BITS, DEVICE_TYPE, IDENTITY, expected_identity
from regolithd.drivers.errors import SdoAbortError
from regolithd.drivers.master.boot_configuration import monitors_master
from regolithd.drivers.master.boot_error import BootReason
from regolithd.drivers.master.events import Identity

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Device
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.master.remote_node import RemoteNode

_MAJOR = 0xFFFF0000  # major revision number: the CANopen behaviour; the minor number may differ


async def read_identity(remote: RemoteNode) -> Identity:
    """Return a node's device type (0x1000) and identity (0x1018); an optional entry that it lacks is 0."""
    device_type = await remote.sdo.read_number(DEVICE_TYPE)
    vendor = await remote.sdo.read_number(IDENTITY, 1)
    rest = []
    for subindex in (2, 3, 4):
        try:
            rest.append(await remote.sdo.read_number(IDENTITY, subindex))
        except SdoAbortError:
            rest.append(0)
    return Identity(device_type, vendor, *rest)


def compare_identity(node: NodeDescription, found: Identity) -> tuple[BootReason, str] | None:
    """Return the first difference between a node's identity and its EDS and description, or None."""
    wanted = expected_identity(node.device)
    checks = (
        (BootReason.WRONG_DEVICE_TYPE, "device type", found.device_type, wanted.device_type, wanted.device_type_mask),
        (BootReason.WRONG_VENDOR, "vendor-ID", found.vendor, wanted.vendor, ALL_BITS),
        (BootReason.WRONG_PRODUCT, "product code", found.product, wanted.product, ALL_BITS),
        (BootReason.WRONG_REVISION, "major revision", found.revision, wanted.revision, _MAJOR),
        (BootReason.WRONG_SERIAL, "serial number", found.serial, node.serial, ALL_BITS),
    )
    for reason, name, value, expected, mask in checks:
        if expected is not None and (value ^ expected) & mask:
            return reason, f"its {name} is 0x{value & mask:08X}, expected 0x{expected & mask:08X} ({node.kind})"
    lowest, highest = wanted.revisions or (0, ALL_BITS)
    if not lowest <= found.revision <= highest:
        what = f"its revision is 0x{found.revision:08X}, expected 0x{lowest:08X} to 0x{highest:08X} ({node.kind})"
        return BootReason.WRONG_REVISION, what
    return None


def unchecked(device: Device) -> tuple[str, ...]:
    """Return the keys of `rover.toml`, table `[devices.…]`, whose values would be compared and are not known."""
    wanted = expected_identity(device)
    known = {"vendor": wanted.vendor, "product": wanted.product, "revisions": wanted.revisions or wanted.revision}
    return tuple(name for name, value in known.items() if value is None)


def reservations(node: NodeDescription, found: Identity) -> str:
    """Return what could not be checked of a node that booted, and what it lacks, in words; empty where nothing."""
    said = ""
    if names := unchecked(node.device):
        values = {"vendor": found.vendor, "product": found.product, "revisions": found.revision}
        said += "; not checked: " + ", ".join(f"{name} (it has 0x{values[name]:08X})" for name in names)
    if node.device.monitors_master and not monitors_master(node):
        said += "; it has no 0x1016 and does not stop by itself when the daemon ends"
    return said
