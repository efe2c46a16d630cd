"""`[devices]` of `rover.toml`: which devices the nodes are, where they are not those that come with regolithd.

[devices.motors]                        # all motors …
profile = "epos4"
eds = "EPOS4 Module 50-5.eds"           # the maker's file

[devices.3]                             # … but node 3; its table counts in place of the kind's
profile = "cia402"
eds = "other.dcf"
vendor = 0x9A
revisions = [0x00010000, 0x0002FFFF]

[devices.3.objects]
motor_speed_rad_s = {unit = "rpm"}
motor_current_A = {object = "0x6078", unit = "mA"}
"""

from __future__ import annotations

import re
from pathlib import Path  # noqa: TC003  # pydantic reads it at run time
from typing import Annotated

from pydantic import AfterValidator, Field

from regolithd.calibration.parameters import Number, Table
from regolithd.drivers.devices.device import KnownIdentity, Setting
from regolithd.drivers.devices.profiles.choice import DeviceChoice, Placement

_OBJECT = re.compile(r"(?:0x)?([0-9A-Fa-f]{4})(?::(?:0x)?([0-9A-Fa-f]{1,2}))?")
Unsigned32 = Annotated[int, Field(ge=0, le=0xFFFF_FFFF, strict=True)]
SettingValue = Annotated[int, Field(strict=True)]


def _object(text: str) -> str:
    """Return an object's name if it is index and sub-index, in hexadecimal."""
    if _OBJECT.fullmatch(text) is None:
        raise ValueError('an object is "0x6078" or "0x30D1:02", index and sub-index in hexadecimal')
    return text


def object_key(text: str) -> tuple[int, int]:
    """Return index and sub-index of an object's name, such as `0x30D1:02`."""
    index, subindex = _OBJECT.fullmatch(text).groups()  # type: ignore[union-attr]  # validated
    return int(index, 16), int(subindex or "0", 16)


ObjectName = Annotated[str, AfterValidator(_object)]


class ObjectChoice(Table):
    """Where one quantity lies, and its unit or scale (to SI); what is left out is as the profile says."""

    object: ObjectName | None = None
    unit: str | None = None
    scale: Number | None = None

    def placement(self, quantity: str) -> Placement:
        """Return it as the drivers take it."""
        key = object_key(self.object) if self.object else None
        return Placement(quantity, key, None if self.scale is not None else self.unit, self.scale)


class DeviceTable(Table):
    """`[devices.…]`: profile, EDS file and identity of the nodes of one kind, or of one node.

    `channel` is the sub-index of an amplifier's input; `serial` is for the table of one node; `settings` are written
    while it boots, in addition to the profile's.
    """

    profile: str | None = None
    eds: Path | None = None
    channel: Annotated[int, Field(ge=1, le=254)] = 1
    vendor: Unsigned32 | None = None
    product: Unsigned32 | None = None
    revisions: tuple[Unsigned32, Unsigned32] | None = None
    serial: Unsigned32 | None = None
    objects: dict[str, ObjectChoice] = Field(default_factory=dict)
    settings: dict[ObjectName, SettingValue] = Field(default_factory=dict)

    def choice(self) -> DeviceChoice:
        """Return it as the drivers take it."""
        return DeviceChoice(
            self.profile,
            self.eds,
            self.channel,
            tuple(each.placement(quantity) for quantity, each in self.objects.items()),
            tuple(Setting(*object_key(name), value) for name, value in self.settings.items()),
            KnownIdentity(vendor=self.vendor, product=self.product, revisions=self.revisions),
        )
