"""Profile, EDS file and `rover.toml` together: the `Device` that boot, decoder and virtual node take.

The PDO layouts follow from the objects' sizes: objects fill the TPDOs that the EDS lists, in their order; a value and
its status object stay together. Status, current and speed of an EPOS4 are ten bytes, hence two TPDOs.
"""

from __future__ import annotations

import struct
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.object_dictionary import known_variable, object_dictionary, struct_code, variable
from regolithd.drivers.canopen.pdo import MAX_BYTES
from regolithd.drivers.devices.device import EVENT_DRIVEN, Measured, PdoLayout
from regolithd.drivers.devices.profiles.shipped import profiles
from regolithd.drivers.devices.units import FIXED_UNITS, STATED_UNITS, StatedUnit, implausible
from regolithd.drivers.errors import DictionaryError

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.drivers.devices.device import Device, KnownIdentity, PdoObject, Quantity, Setting
    from regolithd.drivers.devices.profiles.choice import DeviceChoice, Placement
    from regolithd.drivers.devices.profiles.profile import Profile, Source
    from regolithd.drivers.devices.units import ObjectKey, Scale

_PDOS = 512  # of each direction (CiA 301)
_UNNAMED = 0  # scale of a source whose unit only the user can know


class DescriptionError(DictionaryError):
    """A device cannot be used as `rover.toml` describes it; `key` is the key within its table."""

    def __init__(self, what: str, key: str, *, index: int | None = None, subindex: int = 0, remedy: str = "") -> None:
        self.key = key
        super().__init__(what, index=index, subindex=subindex, remedy=remedy)


@lru_cache(maxsize=256)
def compose(kind: Device, choice: DeviceChoice) -> tuple[Device | None, tuple[DescriptionError, ...]]:
    """Return the device that a choice describes, and every reason why there is none; equal choices, one object."""
    found = [each for each in profiles(kind, choice.channel) if choice.profile in {None, each.name}]
    if not found:
        names = ", ".join(each.name for each in profiles(kind, choice.channel))
        what = f"there is no profile {choice.profile!r} for {kind.configuration_key}"
        return None, (DescriptionError(what, "profile", remedy=f"Take one of {names}"),)
    return _Composition(kind, found[0], choice).result()


class _Composition:
    """Composes one device; collects problems instead of raising them."""

    def __init__(self, kind: Device, profile: Profile, choice: DeviceChoice) -> None:
        self._kind, self._profile, self._choice = kind, profile, choice
        self._eds: Path = choice.eds or profile.eds
        self._problems: list[DescriptionError] = []
        self._left_out: list[str] = []
        self._placements = {each.quantity: each for each in choice.placements}

    def result(self) -> tuple[Device | None, tuple[DescriptionError, ...]]:
        try:
            object_dictionary(self._eds)
        except DictionaryError as error:
            return None, (DescriptionError(error.what, "eds", remedy=error.remedy),)
        self._check_names()
        groups = [(source, self._group(source)) for source in self._profile.sources]
        tpdos = self._pack([(source.diagnostic, group) for source, group in groups if group])
        rpdos = self._commands({source.quantity: group for source, group in groups})
        if self._problems:
            return None, tuple(self._problems)
        return self._device(tpdos, rpdos), ()

    def _device(self, tpdos: tuple[PdoLayout, ...], rpdos: tuple[PdoLayout, ...]) -> Device:
        profile, choice = self._profile, self._choice
        return replace(
            self._kind,
            eds=self._eds,
            tpdos=tpdos,
            rpdos=rpdos,
            settings=_merged(profile.settings, choice.settings),
            error_texts=profile.error_texts,
            identity=_identity(profile.identity, choice.identity),
            left_out=tuple(self._left_out),
        )

    def _problem(self, what: str, key: str, place: ObjectKey | None = None, remedy: str = "") -> None:
        index, subindex = place or (None, 0)
        self._problems.append(DescriptionError(what, key, index=index, subindex=subindex, remedy=remedy))

    def _check_names(self) -> None:
        known = [source.quantity.name for source in self._profile.sources]
        remedy = f"It has {', '.join(known)}"
        for name in self._placements.keys() - set(known):
            self._problem(f"a {self._kind.kind} has no quantity {name!r}", "objects", remedy=remedy)

    # Where each quantity lies

    def _group(self, source: Source) -> tuple[PdoObject, ...]:
        """Return the objects that hold a quantity and its status; empty where there is none, which may be a problem."""
        placement = self._placements.get(source.quantity.name)
        reasons: list[tuple[Measured, DictionaryError]] = []
        for candidate in self._candidates(source, placement):
            try:
                self._check(candidate)
            except DictionaryError as error:
                reasons.append((candidate, error))
            else:
                return self._with_status(candidate, source)
        self._not_offered(source, placement, reasons)
        return ()

    def _candidates(self, source: Source, placement: Placement | None) -> list[Measured]:
        if placement is None:
            return list(source.alternatives)
        objects = [placement.key] if placement.key else [(each.index, each.subindex) for each in source.alternatives]
        if placement.unit is None and placement.scale is None:
            return [replace(each, index=key[0], subindex=key[1]) for key in objects for each in source.alternatives]
        scales = self._scales(source.quantity, placement)
        return [Measured(*key, source.quantity, scale) for key in dict.fromkeys(objects) for scale in scales]

    def _scales(self, quantity: Quantity, placement: Placement) -> list[Scale]:
        key = f"objects.{quantity.name}"
        if placement.scale is not None:
            return [placement.scale]
        name = placement.unit or ""
        if name in STATED_UNITS and quantity.name.endswith(f"_{STATED_UNITS[name][0].dimension}"):
            return list(STATED_UNITS[name])
        if name in FIXED_UNITS and quantity.name.endswith(f"_{FIXED_UNITS[name][0]}"):
            return [FIXED_UNITS[name][1]]
        fitting = [each for each, (end, _) in FIXED_UNITS.items() if quantity.name.endswith(f"_{end}")]
        fitting += [each for each, units in STATED_UNITS.items() if quantity.name.endswith(f"_{units[0].dimension}")]
        what = f"{quantity.name} cannot be in the unit {name!r}"
        self._problem(what, key, remedy=f"Take one of {', '.join(fitting)}; or a scale")
        return []

    def _check(self, candidate: Measured) -> None:
        """Raise `DictionaryError` where the EDS does not offer this object in this unit."""
        entry = variable(self._eds, candidate.index, candidate.subindex)
        if not entry.pdo_mappable:
            raise DictionaryError(
                f"may not be mapped to a PDO, according to {self._eds.name}", index=entry.index, subindex=entry.subindex
            )
        code = struct_code(entry)
        bits = 8 * struct.calcsize("<" + code)
        scale, dimension = candidate.scale, _dimension(candidate.quantity)
        if isinstance(scale, StatedUnit):
            for index, subindex in scale.objects:
                variable(self._eds, index, subindex)
        elif scale == _UNNAMED:
            raise DictionaryError("its unit is not known", index=entry.index, subindex=entry.subindex)
        elif problem := implausible("" if code in "fd" else dimension, scale, bits):
            raise DictionaryError(f"absurd scale: {problem}", index=entry.index, subindex=entry.subindex)

    def _with_status(self, candidate: Measured, source: Source) -> tuple[PdoObject, ...]:
        status = source.validity
        if status is None:
            return (candidate,)
        entry = known_variable(self._eds, status.index, status.subindex)
        if entry is None or not entry.pdo_mappable:
            self._left_out.append(f"status 0x{status.index:04X} of {source.quantity.name}: not in {self._eds.name}")
            return (candidate,)
        return (candidate, status)

    def _not_offered(
        self, source: Source, placement: Placement | None, reasons: list[tuple[Measured, DictionaryError]]
    ) -> None:
        name = source.quantity.name
        if not reasons:
            return  # a wrong unit, reported already
        if source.diagnostic and placement is None:
            self._left_out.append(f"{name}: {reasons[0][1].what}")
            return
        key = f"objects.{name}"
        remedy = (source.cure if placement is None else "Correct object or unit") or self._cure(name)
        objects = dict.fromkeys((each.index, each.subindex) for each, _ in reasons)
        there = [error for each, error in reasons if known_variable(self._eds, each.index, each.subindex)]
        if not there and len(objects) > 1:
            absent = ", ".join(f"0x{index:04X}:{subindex:02X}" for index, subindex in objects)
            self._problem(f"{name}: the EDS file {self._eds.name} has none of {absent}", key, remedy=remedy)
            return
        first = (there or [reasons[0][1]])[0]
        self._problem(f"{name}: {first.what}", key, (first.index or 0, first.subindex), remedy)

    def _cure(self, name: str) -> str:
        table = f"[devices.{self._kind.configuration_key}"
        others = [each.name for each in profiles(self._kind) if each is not self._profile]
        choose = f"Choose the profile of this device ({', '.join(others)}), or s" if others else "S"
        return f'{choose}ay where it lies: `{name} = {{object = "0x…", unit = "…"}}` in {table}.objects]'

    # PDOs

    def _pack(self, groups: list[tuple[bool, tuple[PdoObject, ...]]]) -> tuple[PdoLayout, ...]:
        """Distribute groups of objects over as few TPDOs as their order allows; diagnostic ones have their own."""
        packed: list[tuple[bool, list[PdoObject]]] = []
        for diagnostic, group in groups:
            fresh = [each for each in group if not any(each in objects for _, objects in packed)]
            kept = packed and packed[-1][0] is diagnostic and self._size([*packed[-1][1], *fresh]) <= MAX_BYTES
            if kept:
                packed[-1][1].extend(fresh)
            elif fresh:
                packed.append((diagnostic, list(fresh)))
        numbers = listed_pdos(self._eds, transmit=True)
        if len(packed) > len(numbers):
            what = f"{len(packed)} TPDOs are needed, and {self._eds.name} lists {len(numbers)}"
            self._problem(
                what, "objects", remedy="Choose smaller objects for the quantities, or switch diagnostics off"
            )
            return ()
        return tuple(
            PdoLayout(number, tuple(objects), diagnostic=diagnostic)
            for number, (diagnostic, objects) in zip(numbers, packed, strict=False)
        )

    def _size(self, objects: list[PdoObject]) -> int:
        codes = [struct_code(variable(self._eds, each.index, each.subindex)) for each in objects]
        return struct.calcsize("<" + "".join(codes))

    def _commands(self, groups: dict[Quantity, tuple[PdoObject, ...]]) -> tuple[PdoLayout, ...]:
        profile = self._profile
        if not profile.commands:
            return ()
        unit = next((each.scale for each in groups.get(profile.command_unit_of, ()) if isinstance(each, Measured)), 1.0)  # type: ignore[arg-type]
        first, *rest = profile.commands
        for each in profile.commands:
            entry = known_variable(self._eds, each.index, each.subindex)
            if entry is None or not (entry.pdo_mappable and entry.writable):
                what = "is not in" if entry is None else "cannot be commanded by RPDO, according to"
                remedy = "A drive without it cannot be driven: is this the EDS of the motor controller?"
                self._problem(f"{what} {self._eds.name}", "eds", (each.index, each.subindex), remedy)
        numbers = listed_pdos(self._eds, transmit=False)
        if not numbers:
            self._problem(f"{self._eds.name} lists no RPDO", "eds", remedy="Take the maker's complete EDS file")
            return ()
        return (PdoLayout(numbers[0], (first, *(replace(each, scale=unit) for each in rest)), EVENT_DRIVEN),)


def listed_pdos(eds: Path, *, transmit: bool) -> list[int]:
    """Return the numbers (from 1) of the PDOs that an EDS lists with communication and mapping parameters."""
    dictionary, first = object_dictionary(eds), 0x1800 if transmit else 0x1400
    return [
        number + 1 for number in range(_PDOS) if first + number in dictionary and first + 0x200 + number in dictionary
    ]


def _dimension(quantity: Quantity) -> str:
    """Return the ending of a quantity's name that is its unit, or an empty text."""
    ends = {end for end, _ in FIXED_UNITS.values() if quantity.name.endswith(f"_{end}")}
    return max(ends, key=len, default="")


def _merged(settings: tuple[Setting, ...], own: tuple[Setting, ...]) -> tuple[Setting, ...]:
    """Return the profile's settings with the user's in their place, or after them."""
    given = {(each.index, each.subindex): each for each in own}
    kept = [given.pop((each.index, each.subindex), each) for each in settings]
    return (*kept, *given.values())


def _identity(profile: KnownIdentity, own: KnownIdentity) -> KnownIdentity:
    """Return the profile's identity with what the user stated in its place."""
    return replace(
        profile,
        vendor=profile.vendor if own.vendor is None else own.vendor,
        product=profile.product if own.product is None else own.product,
        revisions=own.revisions or profile.revisions,
    )
