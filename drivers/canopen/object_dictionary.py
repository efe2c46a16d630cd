"""Object dictionaries: the objects that an EDS file (CiA 306) lists, with their types and access rights."""

from __future__ import annotations

import io
from functools import cache
from typing import TYPE_CHECKING

import canopen
from canopen.objectdictionary import ODVariable, datatypes

from regolithd.drivers.errors import DictionaryError

if TYPE_CHECKING:
    from pathlib import Path

_FIRST_OBJECT = 0x1000  # below are data types

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
    """Return the object dictionary of an EDS or DCF file; defaults that depend on the node-ID are for node 0.

    Raises
    ------
    DictionaryError
        There is no such file, or it is no EDS.
    """
    try:
        text = eds.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise DictionaryError(f"the EDS file {eds} cannot be read: {error.strerror}", remedy="Correct `eds`") from error
    try:
        found = parse_eds(text, 0)
    except Exception as error:  # the parser raises whatever a damaged file causes: KeyError, ValueError, …
        what = " ".join(str(error).split()) or type(error).__name__
        raise DictionaryError(
            f"{eds.name} is no EDS file that can be read: {what}", remedy="Take the maker's file anew"
        ) from error
    if not any(isinstance(index, int) and index >= _FIRST_OBJECT for index in found):
        raise DictionaryError(f"{eds.name} describes no object", remedy="Take the maker's EDS or DCF file")
    return found


def parse_eds(text: str, node_id: int) -> canopen.ObjectDictionary:
    """Return the object dictionary in an EDS file's text; raises whatever canopen's parser does."""
    stream = io.StringIO(text)
    stream.name = "text.eds"  # canopen takes the format from the name
    return canopen.import_od(stream, node_id)


def known_variable(eds: Path, index: int, subindex: int = 0) -> ODVariable | None:
    """Return one entry of an EDS file's object dictionary, or None."""
    found: ODVariable | None = object_dictionary(eds).get_variable(index, subindex)
    return found


def writable(eds: Path, index: int, subindex: int = 0) -> bool:
    """Return whether the EDS lists an entry that may be written."""
    entry = known_variable(eds, index, subindex)
    return entry is not None and entry.writable


def variable(eds: Path, index: int, subindex: int = 0) -> ODVariable:
    """Return one entry of an EDS file's object dictionary.

    Raises
    ------
    DictionaryError
        The EDS has no such object.
    """
    entry = known_variable(eds, index, subindex)
    if entry is None:
        raise DictionaryError(
            f"the EDS file {eds.name} has no such object",
            index=index,
            subindex=subindex,
            remedy="Say in [devices] which object holds it, or choose the profile of this device",
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
