"""The PDOs of a kind of device, compiled from its layouts and its EDS."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.object_dictionary import object_dictionary
from regolithd.drivers.canopen.pdo import Pdo, compile_mapping

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Device, PdoLayout, PdoObject

_IDENTIFIER = 0x7FF


@dataclass(frozen=True, slots=True)
class DevicePdo(Pdo):
    """A PDO, and what its mapped objects mean."""

    objects: tuple[PdoObject, ...]


@cache
def tpdos(device: Device, *, diagnostics: bool = False) -> tuple[DevicePdo, ...]:
    """Return the TPDOs that a node of this kind is configured to send."""
    layouts = (layout for layout in device.tpdos if diagnostics or not layout.diagnostic)
    return tuple(compile_pdo(device, layout, transmit=True) for layout in layouts)


@cache
def rpdos(device: Device) -> tuple[DevicePdo, ...]:
    """Return the RPDOs that command a node of this kind."""
    return tuple(compile_pdo(device, layout, transmit=False) for layout in device.rpdos)


def fixed_tpdos(device: Device, node_id: int) -> tuple[int, ...]:
    """Return the COB-IDs of TPDOs that are not used and that the node does not let the master disable."""
    dictionary, used = object_dictionary(device.eds), {pdo.communication_index for pdo in tpdos(device)}
    entries = (dictionary.get_variable(index, 1) for index in range(0x1800, 0x1A00) if index not in used)
    fixed = (each for each in entries if each is not None and not each.writable)
    return tuple(((each.default or 0) & _IDENTIFIER) + (node_id if each.relative else 0) for each in fixed)


def compile_pdo(device: Device, layout: PdoLayout, *, transmit: bool) -> DevicePdo:
    """Return a PDO with its mapping parameters and its struct; `transmit` is seen from the node.

    Raises
    ------
    DictionaryError
        The EDS does not allow this layout.
    """
    keys = [(each.index, each.subindex) for each in layout.objects]
    mapping, compiled = compile_mapping(device.eds, layout.number, keys)
    return DevicePdo(layout.number, transmit, layout.transmission_type, mapping, compiled, layout.objects)
