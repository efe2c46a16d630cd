"""Object dictionaries: what an EDS file (CiA 306) says that a node has."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import canopen
from canopen.objectdictionary import ODVariable, datatypes

from regolithd.drivers.devices.eds import eds_path
from regolithd.drivers.errors import DictionaryError

if TYPE_CHECKING:
    from regolithd.drivers.signals import NodeKind

# CiA 301, table 44: how the numeric types of the drivers' objects lie in a PDO or an SDO, as `struct` codes.
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
def object_dictionary(kind: NodeKind) -> canopen.ObjectDictionary:
    """Return the dictionary that this kind of node is driven by; node-ID-dependent defaults are for node 0."""
    return canopen.import_od(str(eds_path(kind)), node_id=0)


def variable(kind: NodeKind, index: int, subindex: int = 0) -> ODVariable:
    """Return one entry of the dictionary.

    Raises
    ------
    DictionaryError
        The EDS has no such object.
    """
    entry = object_dictionary(kind).get_variable(index, subindex)
    if entry is None:
        raise DictionaryError(
            f"the EDS of {kind.value} nodes has no such object",
            index=index,
            subindex=subindex,
            cure=f"Take the device's own EDS file as drivers/devices/eds/{kind.value}.eds, or map another object",
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
