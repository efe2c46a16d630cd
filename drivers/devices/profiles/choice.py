"""What `rover.toml` says about a kind of device, or about one node: table `[devices.…]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.devices.device import NOTHING_KNOWN, KnownIdentity

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.drivers.devices.device import Setting
    from regolithd.drivers.devices.units import ObjectKey


@dataclass(frozen=True, slots=True)
class Placement:
    """Where one quantity lies, by the user: object, and unit (by name) or scale; None is as the profile says."""

    quantity: str
    key: ObjectKey | None = None
    unit: str | None = None
    scale: float | None = None


@dataclass(frozen=True, slots=True)
class DeviceChoice:
    """Profile, EDS file, and what differs from both. `channel` is the sub-index of a multi-channel amplifier."""

    profile: str | None = None
    eds: Path | None = None
    channel: int = 1
    placements: tuple[Placement, ...] = ()
    settings: tuple[Setting, ...] = ()
    identity: KnownIdentity = NOTHING_KNOWN
