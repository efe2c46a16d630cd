"""Base class of the virtual devices: what a virtual node measures and does, behind its CANopen services."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

from regolithd.drivers.devices.units import ObjectKey, StatedUnit, UnknownUnitError, stated_factor

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.drivers.devices.units import Scale
    from regolithd.drivers.devices.virtual.measurement import Measurement


Key = ObjectKey


@dataclass(frozen=True, slots=True)
class Place:
    """Where one quantity lies, and in which unit."""

    index: int
    subindex: int
    scale: Scale


class ObjectValues(Protocol):
    """The values of the node's object dictionary, as the device itself reads and sets them."""

    def get(self, index: int, sub: int = 0, missing: int | None = None) -> int:
        """Return a value; `missing` where the EDS lists no such object."""

    def put(self, index: int, sub: int, value: float) -> None:
        """Set a value, where the EDS lists the object."""


class ErrorReports(Protocol):
    """The node's EMCY producer."""

    def set(self, code: int, detail: bytes = b"") -> None:
        """Report an error, once for as long as it lasts."""

    def clear(self, code: int | None = None) -> None:
        """End one error, or all."""


class VirtualDevice:
    """A device that measures nothing; each kind overrides what it does.

    `wheel` is 0–5, or None for a device of the body; `places` says where each quantity lies, by its name.
    """

    direction = 1
    """−1 for a motor that is mounted mirrored: it turns backwards, by its own count, when the rover drives forward."""

    latches_errors = False
    """An error lasts until the device is told to reset it, not only until its cause has gone."""

    def __init__(
        self,
        dictionary: ObjectValues,
        errors: ErrorReports,
        wheel: int | None,
        places: Mapping[str, Place] = MappingProxyType({}),
    ) -> None:
        self.dictionary = dictionary
        self.errors = errors
        self.wheel = wheel
        self.places = places

    def put_quantity(self, name: str, value: float) -> None:
        """Put a value in SI units into the object that holds this quantity, in the object's unit."""
        place = self.places.get(name)
        if place is not None:
            self.dictionary.put(place.index, place.subindex, value / self.factor(place.scale))

    def factor(self, scale: Scale) -> float:
        """Return the factor of a unit; one that the device states is taken from its own objects."""
        if not isinstance(scale, StatedUnit):
            return scale
        try:
            return stated_factor(scale, tuple(self.dictionary.get(*key) for key in scale.objects))
        except UnknownUnitError:
            return 1.0  # as a drive whose unit was never set

    def reset(self) -> None:
        """Start anew, as after power-on."""

    def check(self, key: Key, value: int) -> None:
        """Raise `AbortError` where the device does not accept a value."""

    def written(self, key: Key, value: int) -> None:
        """Act on a value that an SDO or a PDO brought."""

    def advance(self, elapsed_s: float) -> None:
        """Let time pass."""

    def measure(self, measurement: Measurement) -> None:
        """Put what is measured into the object dictionary."""

    def connection_lost(self) -> None:
        """React to the loss of the master's heartbeat, or to the NMT command `stop`."""
