"""Tries a node's boot configuration without writing: what the file allows, and what the device itself says.

Each object that booting writes, compares or maps is read. That a value differs is no problem where booting writes it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.drivers.devices.units import UnknownUnitError
from regolithd.drivers.errors import DictionaryError, SdoAbortError
from regolithd.drivers.master.boot_configuration import boot_writes

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from regolithd.drivers.master.boot_configuration import Write
    from regolithd.drivers.master.remote_node import RemoteNode

_WRITE_ONLY = 0x0601_0001


async def try_configuration(remote: RemoteNode, *, heartbeat_s: float, master_id: int) -> tuple[str, ...]:
    """Return what would prevent this node from being booted, one text for each object.

    Raises
    ------
    SdoError, BusError
        It stopped answering.
    """
    try:
        writes = boot_writes(
            remote.node, heartbeat_s=heartbeat_s, master_id=master_id, master_lost_after_s=3 * heartbeat_s
        )
    except DictionaryError as error:
        return (str(error),)
    found = [text async for text in _compared(remote, writes)]
    found += [text async for text in _mapped(remote)]
    return (*found, *[text async for text in _units(remote)])


async def _compared(remote: RemoteNode, writes: tuple[Write, ...]) -> AsyncIterator[str]:
    last = {(write.index, write.subindex): write for write in writes}  # of several, the one that counts
    missing: set[int] = set()
    for (index, subindex), write in last.items():
        if index in missing:
            continue
        place = f"0x{index:04X}:{subindex:02X}"
        try:
            data = await remote.sdo.read(index, subindex)
        except SdoAbortError as error:
            if error.code != _WRITE_ONLY:
                missing.add(index)
                yield f"{place} is in the EDS, and the device does not have it (abort 0x{error.code:08X})"
            continue
        value = int.from_bytes(data, "little")
        if len(data) != write.size:
            yield f"{place} has {8 * write.size} bits in the EDS, and {8 * len(data)} in the device"
        elif write.read_only and (value ^ write.value) & write.mask:
            yield f"{place} {write.difference(value)}"


async def _mapped(remote: RemoteNode) -> AsyncIterator[str]:
    device = remote.node.device
    diagnostics = remote.node.diagnostics
    for layout in (*device.tpdos, *device.rpdos):
        if layout.diagnostic and not diagnostics:
            continue
        for each in layout.objects:
            try:
                await remote.sdo.read(each.index, each.subindex)
            except SdoAbortError as error:
                if error.code != _WRITE_ONLY:
                    yield f"0x{each.index:04X}:{each.subindex:02X} is to be mapped, and the device does not have it"


async def _units(remote: RemoteNode) -> AsyncIterator[str]:
    for index, subindex in remote.node.device.stated_units:
        try:
            remote.stated[index, subindex] = await remote.sdo.read_number(index, subindex)
        except SdoAbortError as error:
            yield f"0x{index:04X}:{subindex:02X} states a unit, and cannot be read: {error.what}"
            return
    try:
        remote.check_units()
    except UnknownUnitError as error:
        yield f"unit: {error}"
