"""The PDOs of a kind of device, compiled from its layouts and its EDS."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.pdo import Pdo, compile_mapping

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Device, PdoLayout, PdoObject


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
