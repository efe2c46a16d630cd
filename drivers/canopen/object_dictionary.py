"""Object dictionaries: the objects that an EDS file (CiA 306) lists, with their types and access rights."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.eds import STRUCT_CODES, parse_eds
from regolithd.drivers.canopen.eds_text import EdsError, decoded
from regolithd.drivers.errors import DictionaryError

if TYPE_CHECKING:
    from pathlib import Path

    import canopen
    from canopen.objectdictionary import ODVariable

_FIRST_OBJECT = 0x1000  # below are data types


@cache
def object_dictionary(eds: Path) -> canopen.ObjectDictionary:
    """Return the object dictionary of an EDS or DCF file; defaults that depend on the node-ID are for node 0.

    Raises
    ------
    DictionaryError
        There is no such file, or it is no EDS.
    """
    found = read_eds(eds, 0)
    if not any(isinstance(index, int) and index >= _FIRST_OBJECT for index in found):
        raise DictionaryError(f"{eds.name} describes no object", remedy="Take the maker's EDS or DCF file")
    return found


def read_eds(eds: Path, node_id: int) -> canopen.ObjectDictionary:
    """Return the object dictionary of an EDS or DCF file, for one node-ID.

    Raises
    ------
    DictionaryError
        There is no such file, it is no EDS, or a value in it cannot be; the message names file, section and entry.
    """
    try:
        text = decoded(eds.read_bytes())
    except OSError as error:
        raise DictionaryError(f"the EDS file {eds} cannot be read: {error.strerror}", remedy="Correct `eds`") from error
    try:
        return parse_eds(text, node_id)
    except EdsError as error:
        remedy = "Correct it there, or take the maker's file anew"
        raise DictionaryError(f"the EDS file {eds.name} cannot be used: {error}", remedy=remedy) from error


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
