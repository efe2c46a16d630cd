"""Writes the EDS files (CiA 306) of the shipped profiles: the objects that regolithd uses, as the makers document them.

    python -m regolithd.drivers.devices.eds.write

A maker's own EDS file, named in `rover.toml`, describes one product and firmware, and is to be preferred.
"""

from __future__ import annotations

from dataclasses import dataclass

from regolithd.drivers.devices.eds import EDS_FOLDER

I8, I16, I32, U8, U16, U32 = 2, 3, 4, 5, 6, 7  # data types (CiA 301, table 44)
_MANDATORY = (0x1000, 0x1001, 0x1018)
_MANUFACTURER = range(0x2000, 0x6000)


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry: sub-index None for an object without sub-indices; `default` as it stands in the file."""

    index: int
    subindex: int | None
    name: str
    data_type: int
    access: str
    default: str = ""
    mappable: bool = False


@dataclass(frozen=True, slots=True)
class Sheet:
    """One EDS file; of `traits`, each says how the device differs from others."""

    name: str
    product: str
    vendor: int
    traits: str
    objects: tuple[Entry, ...]
    tpdos: int = 4
    rpdos: int = 4
    mapping_entries: int = 8
    sync_access: str = "rw"
    emcy_access: str = "rw"


def _value(index: int, name: str, data_type: int, access: str = "rw", default: str = "") -> Entry:
    return Entry(index, None, name, data_type, access, default)


def _process(index: int, name: str, data_type: int, access: str = "ro") -> Entry:
    return Entry(index, None, name, data_type, access, "0", mappable=True)


_DRIVE = (
    _value(0x6007, "Abort connection option code", I16, default="1"),
    _process(0x6040, "Controlword", U16, "rww"),
    _process(0x6041, "Statusword", U16),
    _value(0x6060, "Modes of operation", I8, default="1"),
    _value(0x6061, "Modes of operation display", I8, "ro", "1"),
    _process(0x606C, "Velocity actual value", I32),
    _value(0x607F, "Max profile velocity", U32, default="25000"),
    _value(0x6083, "Profile acceleration", U32, default="10000"),
    _value(0x6084, "Profile deceleration", U32, default="10000"),
    _value(0x6085, "Quick stop deceleration", U32, default="20000"),
    _process(0x60FF, "Target velocity", I32, "rww"),
)
_ERROR_CODE = _process(0x603F, "Error code", U16)
_QUICK_STOP = _value(0x605A, "Quick stop option code", I16, default="2")
_CURRENT = _process(0x6078, "Current actual value", I16)

SHEETS = (
    Sheet(
        "epos2",
        "EPOS2",
        0xFB,
        "no 0x603F and no 0x605A; identity has no defaults; units by 0x608B and 0x608C",
        (
            *_DRIVE,
            _CURRENT,
            _value(0x608B, "Velocity notation index", I8, default="0"),
            _value(0x608C, "Velocity dimension index", U8, default="0xA4"),
        ),
    ),
    Sheet(
        "epos4",
        "EPOS4",
        0xFB,
        "no 0x6078: current in mA is 0x30D1; 0x1005 and 0x1014 cannot be written; unit of speed in 0x60A9",
        (
            *_DRIVE,
            _ERROR_CODE,
            _QUICK_STOP,
            Entry(0x30D1, 1, "Current actual value averaged", I32, "ro", "0", mappable=True),
            Entry(0x30D1, 2, "Current actual value", I32, "ro", "0", mappable=True),
            _value(0x60A9, "SI unit velocity", U32, default="0x00B44700"),
        ),
        mapping_entries=12,
        sync_access="const",
        emcy_access="ro",
    ),
    Sheet(
        "cia402",
        "drive of CiA 402",
        0,
        "0x6078 is per mille of the rated current 0x6075; unit of speed in 0x60A9",
        (
            *_DRIVE,
            _ERROR_CODE,
            _QUICK_STOP,
            _CURRENT,
            _value(0x6075, "Motor rated current", U32, default="1000"),
            _value(0x60A9, "SI unit velocity", U32, default="0x00B44700"),
        ),
    ),
    Sheet(
        "cia404",
        "amplifier of CiA 404",
        0,
        "the process value has the unit of 0x6131, and the decimal digits of 0x6132",
        (
            Entry(0x6112, 1, "AI operating mode 1", U8, "rw", "1"),
            Entry(0x6131, 1, "AI physical unit PV 1", U32, "rw", "0x00210000"),
            Entry(0x6132, 1, "AI decimal digits PV 1", U8, "rw", "1"),
            Entry(0x6150, 1, "AI status 1", U8, "ro", "0", mappable=True),
            Entry(0x9130, 1, "AI input PV 1", I32, "ro", "0", mappable=True),
        ),
        tpdos=1,
        rpdos=0,
    ),
    Sheet(
        "cia401",
        "input module of CiA 401",
        0,
        "an analogue input, without unit: the bridge amplifier before it determines the scale",
        (
            *(Entry(0x6401, k, f"Analogue input {k}", I16, "ro", "0", mappable=True) for k in range(1, 5)),
            _value(0x6423, "Analogue input global interrupt enable", 1, default="0"),
        ),
        tpdos=2,
        rpdos=0,
    ),
)


def text(sheet: Sheet) -> str:
    """Return the file's content."""
    entries = sorted(
        (*_communication(sheet), *sheet.objects),
        key=lambda each: (each.index, -1 if each.subindex is None else each.subindex),
    )
    by_index: dict[int, list[Entry]] = {}
    for each in entries:
        by_index.setdefault(each.index, []).append(each)
    parts = [_head(sheet), *_lists(list(by_index))]
    for index, group in by_index.items():
        parts += _object(index, group)
    return "\n\n".join(parts) + "\n"


def _head(sheet: Sheet) -> str:
    rates = "\n".join(f"BaudRate_{rate}={int(rate > 10)}" for rate in (10, 20, 50, 125, 250, 500, 800, 1000))
    made = "\n".join(f"{word}Time=09:00AM\n{word}Date=11-22-2026" for word in ("Creation", "Modification"))
    return (
        f"[FileInfo]\nFileName={sheet.name}.eds\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\n"
        f"Description={sheet.product}, as much as regolithd uses\n{made}\nCreatedBy=regolithd\nModifiedBy=regolithd\n\n"
        f"[Comments]\nLines=1\nLine1={sheet.traits}\n\n"
        f"[DeviceInfo]\nVendorName=\nVendorNumber=0x{sheet.vendor:08X}\nProductName={sheet.product}\n"
        f"ProductNumber=0\nRevisionNumber=0\nOrderCode=\n{rates}\nSimpleBootUpMaster=0\nSimpleBootUpSlave=1\n"
        f"Granularity=8\nDynamicChannelsSupported=0\nGroupMessaging=0\nNrOfRXPDO={sheet.rpdos}\n"
        f"NrOfTXPDO={sheet.tpdos}\nLSS_Supported=0\n\n"
        "[DummyUsage]\n" + "\n".join(f"Dummy{number:04d}=0" for number in range(1, 8))
    )


def _lists(indices: list[int]) -> list[str]:
    manufacturer = [index for index in indices if index in _MANUFACTURER]
    optional = [index for index in indices if index not in (*_MANDATORY, *manufacturer)]
    return [
        "\n".join(
            [f"[{name}]", f"SupportedObjects={len(of)}", *(f"{k}=0x{index:04X}" for k, index in enumerate(of, 1))]
        )
        for name, of in (
            ("MandatoryObjects", list(_MANDATORY)),
            ("OptionalObjects", optional),
            ("ManufacturerObjects", manufacturer),
        )
    ]


def _object(index: int, group: list[Entry]) -> list[str]:
    if group[0].subindex is None:
        return [_entry(f"{index:04X}", group[0])]
    if group[0].subindex:  # the highest sub-index is not listed above
        group = [Entry(index, 0, "Highest sub-index supported", U8, "const", str(group[-1].subindex)), *group]
    head = f"[{index:04X}]\nParameterName={group[1].name}\nObjectType=0x9\nSubNumber={len(group)}"
    return [head, *(_entry(f"{index:04X}sub{each.subindex:X}", each) for each in group)]


def _entry(section: str, each: Entry) -> str:
    lines = [f"[{section}]", f"ParameterName={each.name}", "ObjectType=0x7", f"DataType=0x{each.data_type:04X}"]
    lines.append(f"AccessType={each.access}")
    if each.default:
        lines.append(f"DefaultValue={each.default}")
    return "\n".join([*lines, f"PDOMapping={int(each.mappable)}"])


def _communication(sheet: Sheet) -> list[Entry]:
    return [
        _value(0x1000, "Device type", U32, "ro"),
        _value(0x1001, "Error register", U8, "ro", "0"),
        Entry(0x1003, 0, "Number of errors", U8, "rw", "0"),
        *(Entry(0x1003, k, f"Error history {k}", U32, "ro", "0") for k in range(1, 6)),
        _value(0x1005, "COB-ID SYNC", U32, sheet.sync_access, "0x80"),
        _value(0x1014, "COB-ID EMCY", U32, sheet.emcy_access, "$NODEID+0x80"),
        Entry(0x1016, 1, "Consumer heartbeat time 1", U32, "rw", "0"),
        _value(0x1017, "Producer heartbeat time", U16, "rw", "0"),
        *(
            Entry(0x1018, k, name, U32, "ro")
            for k, name in enumerate(("Vendor-ID", "Product code", "Revision number", "Serial number"), 1)
        ),
        Entry(0x1200, 1, "COB-ID client to server", U32, "ro", "$NODEID+0x600"),
        Entry(0x1200, 2, "COB-ID server to client", U32, "ro", "$NODEID+0x580"),
        *(each for k in range(sheet.rpdos) for each in _pdo(sheet, k, "R", 0x1400, 0x200)),
        *(each for k in range(sheet.tpdos) for each in _pdo(sheet, k, "T", 0x1800, 0x180)),
    ]


def _pdo(sheet: Sheet, place: int, direction: str, index: int, cob_id: int) -> list[Entry]:
    name, mapping = f"{direction}PDO {place + 1}", index + 0x200 + place
    return [
        Entry(
            index + place, 1, f"COB-ID used by {name}", U32, "rw", f"$NODEID+0x{0x8000_0000 + cob_id + 0x100 * place:X}"
        ),
        Entry(index + place, 2, f"Transmission type {name}", U8, "rw", "255"),
        Entry(mapping, 0, f"Number of mapped objects in {name}", U8, "rw", "0"),
        *(
            Entry(mapping, k, f"Mapped object {k} in {name}", U32, "rw", "0")
            for k in range(1, sheet.mapping_entries + 1)
        ),
    ]


def main() -> None:
    """Write the files into this folder."""
    for sheet in SHEETS:
        (EDS_FOLDER / f"{sheet.name}.eds").write_text(text(sheet), encoding="utf-8")


if __name__ == "__main__":
    main()
