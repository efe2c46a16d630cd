"""Object dictionaries: the objects that an EDS file (CiA 306) lists, with their types and access rights."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import canopen
from canopen.objectdictionary import ODVariable, datatypes

from regolithd.drivers.errors import DictionaryError

if TYPE_CHECKING:
    from pathlib import Path

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


@cache
def object_dictionary(eds: Path) -> canopen.ObjectDictionary:
    """Return the object dictionary of an EDS file; defaults that depend on the node-ID are for node 0."""
    return canopen.import_od(str(eds), node_id=0)


def variable(eds: Path, index: int, subindex: int = 0) -> ODVariable:
    """Return one entry of an EDS file's object dictionary.

    Raises
    ------
    DictionaryError
        The EDS has no such object.
    """
    entry = object_dictionary(eds).get_variable(index, subindex)
    if entry is None:
        raise DictionaryError(
            f"the EDS file {eds.name} has no such object",
            index=index,
            subindex=subindex,
            remedy="Put the device's own EDS file in its place, or map another object",
        )
    return entry


def struct_code(entry: ODVariable) -> str:
    """Return the `struct` code of an entry's data type.

    Raises
    ------
    DictionaryError
        It is not a number of fixed size.
    """
    code = STRUCT_CODES.get(entry.data_type or 0)
    if code is None:
        raise DictionaryError("its data type is not a number of fixed size", index=entry.index, subindex=entry.subindex)
    return code
