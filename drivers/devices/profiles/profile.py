"""A profile: where a device of some make or standard holds each quantity, before its EDS file is known."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from regolithd.drivers.devices.device import (
    NOTHING_KNOWN,
    Commanded,
    Device,
    KnownIdentity,
    Measured,
    Setting,
    Validity,
)

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from regolithd.drivers.devices.device import Quantity


@dataclass(frozen=True, slots=True)
class Source:
    """Where one quantity may lie.

    Attributes
    ----------
    quantity
        What is measured.
    alternatives
        The first one counts whose object, and whose objects that state its unit, the EDS lists.
    validity
        Its status object; used where the EDS lists it.
    diagnostic
        Left out where the EDS does not offer it, and configured only with `motor_diagnostics`.
    cure
        What to write into `rover.toml` where no alternative is there.
    """

    quantity: Quantity
    alternatives: tuple[Measured, ...]
    validity: Validity | None = None
    diagnostic: bool = False
    cure: str = ""


@dataclass(frozen=True, slots=True)
class Profile:
    """Objects, settings and identity of devices of one make, or of one CiA device profile.

    `commands` are the objects of RPDO 1; one with a unit is in that of `command_unit_of`'s source. `eds` is the EDS
    file that counts where `rover.toml` names none.
    """

    name: str
    kind: str
    description: str
    sources: tuple[Source, ...]
    eds: Path
    commands: tuple[Commanded, ...] = ()
    command_unit_of: Quantity | None = None
    settings: tuple[Setting, ...] = ()
    identity: KnownIdentity = NOTHING_KNOWN
    error_texts: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))


def built_in(device: Device, name: str, command_unit_of: Quantity | None = None) -> Profile:
    """Return the profile of a kind of device as it is registered, with its own EDS file."""
    sources = []
    for layout in device.tpdos:
        validity = next((each for each in layout.objects if isinstance(each, Validity)), None)
        sources += [
            Source(each.quantity, (each,), validity, diagnostic=layout.diagnostic)
            for each in layout.objects
            if isinstance(each, Measured)
        ]
    commands = tuple(each for layout in device.rpdos for each in layout.objects if isinstance(each, Commanded))
    return Profile(
        name,
        device.kind,
        "the device of the EDS file that comes with regolithd",
        tuple(sources),
        device.eds,
        commands,
        command_unit_of,
        device.settings,
        device.identity,
        device.error_texts,
    )
