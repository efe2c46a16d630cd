"""CANopenNode's example object dictionary (OD.c, OD.h) with the application objects and the identity of an EDS file.

python object_dictionary.py EXAMPLE_FOLDER EDS OUTPUT_FOLDER
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import canopen
from canopen.objectdictionary import ODVariable

if TYPE_CHECKING:
    from collections.abc import Iterator

FIRST_APPLICATION_OBJECT = 0x2000
C_TYPES = {1: "uint8_t", 2: "int8_t", 3: "int16_t", 4: "int32_t", 5: "uint8_t", 6: "uint16_t", 7: "uint32_t"}
SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 1, 6: 2, 7: 4}


def attributes(entry: ODVariable) -> str:
    """Return an entry's attributes, as CANopenNode names them."""
    found = ["ODA_SDO_RW" if entry.writable else "ODA_SDO_R"]
    if entry.pdo_mappable:
        found.append("ODA_TRPDO" if entry.writable else "ODA_TPDO")
    if SIZES[entry.data_type] > 1:
        found.append("ODA_MB")
    return " | ".join(found)


def objects(eds: Path) -> Iterator[tuple[int, list[ODVariable], bool]]:
    """Yield index, numeric entries, and whether it is a record, of each application object."""
    for index, found in sorted(canopen.import_od(str(eds), node_id=0).items()):
        record = not isinstance(found, ODVariable)
        entries = [each for each in (found.values() if record else [found]) if each.data_type in C_TYPES]
        if index >= FIRST_APPLICATION_OBJECT and entries:
            yield index, entries, record


def fields(entry: ODVariable, *, record: bool) -> str:
    """Return the initialiser of an entry's descriptor."""
    own = f".subIndex = {entry.subindex}, " if record else ""
    return (
        f"{{ .dataOrig = &app_{entry.index:04X}_{entry.subindex}, {own}.attribute = {attributes(entry)}, "
        f".dataLength = {SIZES[entry.data_type]} }}"
    )


def main() -> None:
    """Write OD.c and OD.h."""
    example, eds, output = (Path(each) for each in sys.argv[1:])
    data, types, initial, listed = [], [], [], []
    for index, entries, record in objects(eds):
        data += [f"{C_TYPES[e.data_type]} app_{index:04X}_{e.subindex} = {e.default or 0};" for e in entries]
        kind, count = ("OD_obj_record_t", f"[{len(entries)}]") if record else ("OD_obj_var_t", "")
        types.append(f"    {kind} o_{index:04X}{count};")
        values = ", ".join(fields(e, record=record) for e in entries)
        initial.append(f"    .o_{index:04X} = {{ {values} }}" if record else f"    .o_{index:04X} = {values}")
        place = f"&ODObjs.o_{index:04X}" + ("[0]" if record else "")
        listed.append(f"    {{0x{index:04X}, {len(entries)}, {'ODT_REC' if record else 'ODT_VAR'}, {place}, NULL}}")
    source = identified((example / "OD.c").read_text(), eds)
    source = source.replace("} ODObjs_t;", "\n".join([*types, "} ODObjs_t;"]), 1)
    start = source.index("static CO_PROGMEM ODObjs_t ODObjs")
    end = source.index("\n};", start)
    source = source[:end] + ",\n" + ",\n".join(initial) + source[end:]
    last = "    {0x0000, 0x00, 0, NULL, NULL}"
    source = source.replace(last, ",\n".join([*listed, last]), 1)
    place = source.index("typedef struct")
    source = source[:place] + "\n".join(data) + "\n\n" + source[place:]
    output.mkdir(parents=True, exist_ok=True)
    (output / "OD.c").write_text(source)
    (output / "OD.h").write_text((example / "OD.h").read_text())


def identified(source: str, eds: Path) -> str:
    """Return the example with the EDS file's device type and identity."""
    od = canopen.import_od(str(eds), node_id=0)
    names = (("x1000_deviceType", 0x1000, 0), ("vendor_ID", 0x1018, 1), ("productCode", 0x1018, 2))
    for name, index, subindex in (*names, ("revisionNumber", 0x1018, 3)):
        value = od.get_variable(index, subindex).default or 0
        source = re.sub(rf"(\.{name} = )0x\w+", rf"\g<1>0x{value:08X}", source)
    return source


if __name__ == "__main__":
    main()
