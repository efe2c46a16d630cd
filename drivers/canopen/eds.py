"""Object dictionaries from EDS and DCF files (CiA 306-1), as objects of the canopen package.

The package has a parser of its own. This one differs: it reads defaults in two's complement, `CompactSubObj` and
`CompactPDO`; an array has the sub-indices that the file gives it, and no others; an error names section and entry.
"""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING

import canopen
from canopen.objectdictionary import ODRecord, ODVariable, datatypes

from regolithd.drivers.canopen.eds_text import EdsError, Section, expression, fitted, real, sections

if TYPE_CHECKING:
    from collections.abc import Mapping

# CiA 301, table 44: the numeric data types in a PDO or an SDO, as `struct` codes.
STRUCT_CODES = {
    datatypes.BOOLEAN: "?",
    datatypes.INTEGER8: "b",
    datatypes.INTEGER16: "h",
    datatypes.INTEGER32: "i",
    datatypes.INTEGER64: "q",
    datatypes.UNSIGNED8: "B",
    datatypes.UNSIGNED16: "H",
    datatypes.UNSIGNED32: "I",
    datatypes.UNSIGNED64: "Q",
    datatypes.REAL32: "f",
    datatypes.REAL64: "d",
}
_TYPE_NAMES = {number: name for name, number in vars(datatypes).items() if name.isupper() and isinstance(number, int)}
_OBJECT = re.compile(r"[0-9a-f]{4}")
_ENTRY = re.compile(r"([0-9a-f]{4})sub([0-9a-f]{1,2})")
_DOMAIN, _VAR, _ARRAY, _RECORD = 2, 7, 8, 9  # object types, CiA 301
_ACCESS = ("ro", "wo", "rw", "rwr", "rww", "const")
_STANDARD_TYPES = 0x1B  # up to UNSIGNED64; the file itself describes others
_BIT_RATES_kBd = (10, 20, 50, 125, 250, 500, 800, 1000)
_DEVICE_TEXTS = {"VendorName": "vendor_name", "ProductName": "product_name", "OrderCode": "order_code"}
_DEVICE_NUMBERS = {
    "VendorNumber": "vendor_number",
    "ProductNumber": "product_number",
    "RevisionNumber": "revision_number",
    "NrOfRXPDO": "nr_of_RXPDO",
    "NrOfTXPDO": "nr_of_TXPDO",
}
_PDOS = 512  # of each direction, CiA 301
_MAPPED = 64  # objects in one PDO
_NOT_USED = 0x8000_0000  # bit 31 of a COB-ID
_EVENT_DRIVEN = 255
# CompactPDO: which sub-indices of the communication parameters there are; name and data type of each.
_COMMUNICATION = (
    (0x01, 1, "COB-ID", datatypes.UNSIGNED32),
    (0x02, 2, "Transmission type", datatypes.UNSIGNED8),
    (0x04, 3, "Inhibit time", datatypes.UNSIGNED16),
    (0x08, 4, "Compatibility entry", datatypes.UNSIGNED8),
    (0x10, 5, "Event timer", datatypes.UNSIGNED16),
    (0x20, 6, "SYNC start value", datatypes.UNSIGNED8),
)


def parse_eds(text: str, node_id: int) -> canopen.ObjectDictionary:
    """Return the object dictionary in a file's text; `$NODEID` in it is `node_id`.

    Raises
    ------
    EdsError
        The text is no EDS; or a value in it cannot be: the message names section and entry.
    """
    found = sections(text)
    dictionary = canopen.ObjectDictionary()  # type: ignore[no-untyped-call]
    dictionary.node_id = node_id
    _take_device_information(dictionary, found.get("deviceinfo", Section("DeviceInfo")))
    for name, section in found.items():
        if _OBJECT.fullmatch(name):
            _add_object(dictionary, section, found, node_id)
    for name, section in found.items():
        if match := _ENTRY.fullmatch(name):
            _add_entry(dictionary, section, int(match[1], 16), int(match[2], 16), found, node_id)
    _add_compact_pdos(dictionary, found.get("deviceinfo", Section("DeviceInfo")), node_id)
    return dictionary


def _take_device_information(dictionary: canopen.ObjectDictionary, section: Section) -> None:
    known = dictionary.device_information
    for entry, name in _DEVICE_TEXTS.items():
        setattr(known, name, section.text(entry) or None)
    for entry, name in _DEVICE_NUMBERS.items():
        setattr(known, name, section.number(entry, -1) if section.text(entry) else None)
    known.allowed_baudrates |= {1000 * rate for rate in _BIT_RATES_kBd if section.number(f"BaudRate_{rate}", 0)}


def _add_object(
    dictionary: canopen.ObjectDictionary, section: Section, found: Mapping[str, Section], node_id: int
) -> None:
    index, kind = int(section.name, 16), section.number("ObjectType", _VAR)
    if kind in (_VAR, _DOMAIN):
        dictionary.add_object(_variable(section, index, 0, found, node_id))
    elif kind in (_ARRAY, _RECORD):
        record = ODRecord(section.text("ParameterName") or section.name, index)
        dictionary.add_object(record)
        if count := section.number("CompactSubObj", 0):
            _add_compact_entries(record, section, count, found, node_id)


def _add_entry(
    dictionary: canopen.ObjectDictionary,
    section: Section,
    index: int,
    subindex: int,
    found: Mapping[str, Section],
    node_id: int,
) -> None:
    parent = dictionary.get(index)
    if parent is None and f"{index:04x}" not in found:
        raise EdsError(f"[{section.name}]: there is no section [{index:04X}], the object that it is a part of")
    if isinstance(parent, ODRecord):
        parent.add_member(_variable(section, index, subindex, found, node_id))


def _add_compact_entries(
    record: ODRecord, section: Section, count: int, found: Mapping[str, Section], node_id: int
) -> None:
    """Add the entries of `CompactSubObj`: sub-index 0 with their number, and as many that only differ in the name.

    `[xxxxName]` may name some of them, and `[xxxxValue]` give some a value of their own (DCF).
    """
    if not 0 < count < 0xFF:
        raise section.bad("CompactSubObj", "is no number from 1 to 254")
    low = section.name.lower()
    names, values = found.get(f"{low}name", Section("")), found.get(f"{low}value", Section(""))
    for subindex in range(1, count + 1):
        each = Section(section.name)
        each.update(section)
        each["parametername"] = names.text(str(subindex)) or f"{record.name} {subindex}"
        if value := values.text(str(subindex)):
            each["parametervalue"] = value
        record.add_member(_variable(each, record.index, subindex, found, node_id))
    mapping = 0x1600 <= record.index < 0x1800 or 0x1A00 <= record.index < 0x1C00
    access = record[1].access_type if mapping else "ro"  # the number of mapped objects is as writable as these are
    record.add_member(_entry(record.index, 0, "Number of entries", datatypes.UNSIGNED8, count, access))


def _add_compact_pdos(dictionary: canopen.ObjectDictionary, section: Section, node_id: int) -> None:
    """Add the PDOs that `CompactPDO` says there are, and that no section describes: those of the lowest numbers."""
    mask = section.number("CompactPDO", 0)
    if not mask:
        return
    for entry, first, cob_id in (("NrOfRXPDO", 0x1400, 0x200), ("NrOfTXPDO", 0x1800, 0x180)):
        count = section.number(entry, 0)
        there = sum(first + number in dictionary for number in range(_PDOS))
        absent = [number for number in range(_PDOS) if first + number not in dictionary]
        for number in absent[: max(count - there, 0)]:
            used = (cob_id + 0x100 * number + node_id) if number < 4 else 0  # CiA 301: predefined for four of them
            dictionary.add_object(_communication(first + number, mask, used))
        for number in range(_PDOS):
            if first + number in dictionary and first + 0x200 + number not in dictionary:
                dictionary.add_object(_mapping(first + 0x200 + number))


def _communication(index: int, mask: int, cob_id: int) -> ODRecord:
    record = ODRecord(f"PDO communication parameter 0x{index:04X}", index)
    subindices = [subindex for bit, subindex, _, _ in _COMMUNICATION if mask & bit]
    record.add_member(_entry(index, 0, "Number of entries", datatypes.UNSIGNED8, max(subindices, default=0), "ro"))
    for bit, subindex, name, data_type in _COMMUNICATION:
        if mask & bit:
            default = {1: cob_id or _NOT_USED, 2: _EVENT_DRIVEN}.get(subindex, 0)
            record.add_member(_entry(index, subindex, name, data_type, default, "rw"))
            record[subindex].relative = subindex == 1 and bool(cob_id)
    return record


def _mapping(index: int) -> ODRecord:
    record = ODRecord(f"PDO mapping parameter 0x{index:04X}", index)
    record.add_member(_entry(index, 0, "Number of mapped objects", datatypes.UNSIGNED8, 0, "rw"))
    for subindex in range(1, _MAPPED + 1):
        record.add_member(_entry(index, subindex, f"Mapped object {subindex}", datatypes.UNSIGNED32, 0, "rw"))
    return record


def _entry(index: int, subindex: int, name: str, data_type: int, default: int, access: str) -> ODVariable:
    entry = ODVariable(name, index, subindex)
    entry.data_type, entry.default, entry.access_type = data_type, default, access
    return entry


def _variable(section: Section, index: int, subindex: int, found: Mapping[str, Section], node_id: int) -> ODVariable:
    entry = ODVariable(section.text("ParameterName") or section.name, index, subindex)
    domain = section.number("ObjectType", _VAR) == _DOMAIN
    entry.data_type = _data_type(section, found, datatypes.DOMAIN if domain else None)
    entry.access_type = section.text("AccessType").lower() or ("ro" if domain else "")
    if entry.access_type not in _ACCESS:
        raise section.bad("AccessType", f"is none of {', '.join(_ACCESS)}")
    entry.pdo_mappable = bool(section.number("PDOMapping", 0))
    entry.min = _limit(section, "LowLimit", entry.data_type, node_id)
    entry.max = _limit(section, "HighLimit", entry.data_type, node_id)
    if entry.min is not None and entry.max is not None and entry.min > entry.max:
        entry.min = entry.max = None  # 0xFFFFFFFF as the highest INTEGER32, and the like: no limit at all
    entry.relative = "$NODEID" in section.text("DefaultValue").upper()
    entry.default = _value(section, "DefaultValue", entry.data_type, node_id)  # type: ignore[assignment]  # texts too
    entry.value = _value(section, "ParameterValue", entry.data_type, node_id)  # type: ignore[assignment]  # likewise
    return entry


def _data_type(section: Section, found: Mapping[str, Section], default: int | None) -> int:
    data_type = section.number("DataType", default)
    if data_type <= _STANDARD_TYPES:
        return data_type
    own = found.get(f"{data_type:x}sub1")  # as CANFestival's editor describes types with limits
    return datatypes.DOMAIN if own is None else own.number("DefaultValue", datatypes.DOMAIN)


def _limit(section: Section, name: str, data_type: int, node_id: int) -> int | None:
    value = _value(section, name, data_type, node_id) if data_type in STRUCT_CODES else None
    return value if isinstance(value, int) else None


def _value(section: Section, name: str, data_type: int, node_id: int) -> int | float | str | bytes | None:
    """Return a value in its data type; None where there is none, or the type is neither a number nor a text.

    Raises
    ------
    EdsError
        It is no number, or has more bits than its type.
    """
    text = section.text(name)
    if not text or data_type not in STRUCT_CODES:
        return _other(text, data_type)
    code, kind = STRUCT_CODES[data_type], _TYPE_NAMES[data_type]
    bits = 8 * struct.calcsize("<" + code)
    if code in "fd":
        found = real(text, bits)
        if found is None:
            raise section.bad(name, f"is no {kind}")
        return found
    number = expression(text, node_id)
    if number is None:
        raise section.bad(name, "is no number, nor $NODEID+number")
    fitting = fitted(number, bits, signed=code.islower())
    if fitting is None:
        raise section.bad(name, f"does not fit an {kind}")
    return fitting


def _other(text: str, data_type: int) -> str | bytes | None:
    if not text:
        return None
    if data_type in (datatypes.VISIBLE_STRING, datatypes.UNICODE_STRING):
        return text
    try:
        return bytes.fromhex(text.removeprefix("0x"))
    except ValueError:
        return None
