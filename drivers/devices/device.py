"""Description of a kind of device: one frozen `Device` for each, listed in `devices.registry`.

Everything that depends on the kind follows from it: boot configuration, PDO decoding, the key in `rover.toml`, the rows
of a snapshot, MQTT fields, recorded and exported columns, `docs/reference/bus.md`, and the virtual rover's node.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from regolithd.drivers.devices.units import StatedUnit

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from regolithd.drivers.devices.units import ObjectKey, Scale
    from regolithd.drivers.devices.virtual.device import VirtualDevice

SYNCHRONOUS = 1  # PDO transmission type (CiA 301, 7.5.2.35): at every SYNC
EVENT_DRIVEN = 255  # at once


@dataclass(frozen=True, slots=True, eq=False)
class Quantity:
    """A measured quantity, in SI units (temperatures in °C).

    Attributes
    ----------
    name
        Its column in recordings, exports and messages; ends in the unit.
    description
        Meaning and sign convention, as in the message schemas.
    per_wheel
        Six values, one a wheel; otherwise one value for the body.
    mirrored
        Its sign is that of the motor's own direction of rotation, so it is inverted for a motor that is mounted
        mirrored.
    flags
        A bit field: published as an integer, and not exported.
    noisy
        A working sensor's reading changes from one SYNC to the next while the wheel turns; one that stays constant
        raises the stuck-sensor alarm. For quantities per wheel only.
    """

    name: str
    description: str = ""
    per_wheel: bool = True
    mirrored: bool = False
    flags: bool = False
    noisy: bool = False

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Measured:
    """An object that holds a measurement: `quantity` = raw value × `scale`, in the quantity's unit.

    `scale` is a number, or a unit that the device states (`devices.units`).
    """

    index: int
    subindex: int
    quantity: Quantity
    scale: Scale


@dataclass(frozen=True, slots=True)
class Validity:
    """A status object: where raw value & `mask` is not 0, the other objects of its PDO hold no valid measurement."""

    index: int
    subindex: int
    mask: int


@dataclass(frozen=True, slots=True)
class Commanded:
    """An object that the master writes by RPDO; a commanded quantity is the raw value × `scale`, as in `Measured`."""

    index: int
    subindex: int = 0
    scale: Scale = 1.0


PdoObject = Measured | Validity | Commanded


@dataclass(frozen=True, slots=True)
class PdoLayout:
    """Which objects the master maps into one PDO.

    `number` counts from 1. A `diagnostic` PDO is configured only where the node's description asks for diagnostics.
    """

    number: int
    objects: tuple[PdoObject, ...]
    transmission_type: int = SYNCHRONOUS
    diagnostic: bool = False


@dataclass(frozen=True, slots=True)
class Setting:
    """A value written during boot.

    Where the EDS lacks the object it is left out; where the EDS says that it cannot be written, it is only compared: a
    wrong unit would be a wrong measurement that looks right.
    """

    index: int
    subindex: int
    value: int


@dataclass(frozen=True, slots=True)
class KnownIdentity:
    """Identity of a device as far as it is known beside its EDS; None is not known.

    Attributes
    ----------
    profile_number
        CiA device profile, the lower 16 bits of 0x1000.
    vendor, product
        0x1018:01 and :02.
    revisions
        Lowest and highest 0x1018:03 that is accepted; None accepts the EDS's own major revision.
    """

    profile_number: int | None = None
    vendor: int | None = None
    product: int | None = None
    revisions: tuple[int, int] | None = None


NOTHING_KNOWN = KnownIdentity()


@dataclass(frozen=True, slots=True, eq=False)
class Device:
    """A kind of device, or one that `rover.toml` describes (`devices.profiles`).

    Attributes
    ----------
    kind
        Its name in MQTT messages, alarms and error messages.
    configuration_key
        Its key in `rover.toml`, table `[nodes]`: six node-IDs for a device per wheel, otherwise one, which may be
        left out.
    eds
        Electronic data sheet (CiA 306). The master and the virtual node both read it.
    default_node_id
        Of the device on wheel 1 (those of wheels 2 to 6 follow), or of the body's device.
    tpdos
        What it sends; every `Quantity` that it measures occurs here.
    rpdos
        What commands it.
    settings
        What is written while it boots, beside PDOs and heartbeat.
    virtual
        The virtual device: what a virtual node of this kind measures and does.
    per_wheel
        Six of them, one a wheel; otherwise one for the body.
    monitors_master
        It consumes the master's heartbeat (0x1016) and stops by itself when that ends.
    error_texts
        The manufacturer's own EMCY error codes.
    identity
        What is known of its identity beside the EDS.
    left_out
        Quantities that the EDS does not offer, and why, in words.
    """

    kind: str
    configuration_key: str
    eds: Path
    default_node_id: int
    tpdos: tuple[PdoLayout, ...]
    virtual: type[VirtualDevice]
    rpdos: tuple[PdoLayout, ...] = ()
    settings: tuple[Setting, ...] = ()
    per_wheel: bool = False
    monitors_master: bool = False
    error_texts: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))
    identity: KnownIdentity = NOTHING_KNOWN
    left_out: tuple[str, ...] = ()

    @property
    def commanded(self) -> bool:
        """Whether the master moves it: a motor controller."""
        return bool(self.rpdos)

    @property
    def stated_units(self) -> tuple[ObjectKey, ...]:
        """The objects in which it states units, without repetition."""
        scales = (
            each.scale
            for layout in (*self.tpdos, *self.rpdos)
            for each in layout.objects
            if isinstance(each, Measured | Commanded)
        )
        return tuple(dict.fromkeys(key for scale in scales if isinstance(scale, StatedUnit) for key in scale.objects))

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What it measures, in the order of its TPDOs."""
        return tuple(each.quantity for layout in self.tpdos for each in layout.objects if isinstance(each, Measured))

    @property
    def validity(self) -> Validity | None:
        """Its status object, or None."""
        found = (each for layout in self.tpdos for each in layout.objects if isinstance(each, Validity))
        return next(found, None)
