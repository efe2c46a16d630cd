"""EDS and DCF files as makers write them (CiA 306): values, compact storage, and errors that name the place."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING

import canopen
import pytest
from canopen.objectdictionary import ODVariable

from regolithd.drivers.canopen.eds import parse_eds
from regolithd.drivers.canopen.eds_text import EdsError, decoded
from regolithd.drivers.canopen.object_dictionary import object_dictionary
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.profiles.compose import listed_pdos
from regolithd.drivers.errors import DictionaryError
from regolithd.drivers.virtual.object_dictionary import Dictionary

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

NODE = 5
VARIABLE = "[{index}]\nParameterName=x\nObjectType=0x7\nDataType={data_type}\nAccessType=rw\nDefaultValue={default}\n"


def entry(default: str, data_type: str = "0x0003", extra: str = "") -> ODVariable:
    """Return the only object of a file."""
    text = VARIABLE.format(index="6007", data_type=data_type, default=default) + extra
    return parse_eds(text, NODE).get_variable(0x6007)


def described(dictionary: canopen.ObjectDictionary) -> dict[tuple[int, int], tuple[object, ...]]:
    """Return what counts of each entry."""
    entries: Iterable[ODVariable] = (
        each for found in dictionary.values() for each in ([found] if isinstance(found, ODVariable) else found.values())
    )
    return {
        (each.index, each.subindex): (
            *(each.data_type, each.access_type, each.default, each.value, each.min, each.max),
            *(bool(each.pdo_mappable), bool(each.relative), each.name),
        )
        for each in entries
    }


@pytest.mark.parametrize("path", sorted(EDS_FOLDER.glob("*.eds")), ids=lambda path: path.name)
def test_files_that_the_canopen_package_reads_are_read_alike(path: Path) -> None:
    """Every entry, with its type, access, values, limits and name."""
    text = path.read_text()
    stream = io.StringIO(text)
    stream.name = path.name
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        theirs = canopen.import_od(stream, NODE)
    assert described(parse_eds(text, NODE)) == described(theirs)


@pytest.mark.parametrize(
    ("default", "data_type", "value"),
    [
        ("0xFFFF", "0x0003", -1),
        ("0x8000", "3", -32768),
        ("0xFD", "0x0002", -3),
        ("0xFFFFFFFE", "0x0004", -2),
        ("65535", "0x0003", -1),
        ("-1", "0x0003", -1),
        ("-1", "0x0007", 0xFFFF_FFFF),
        ("5000.0", "0x0007", 5000),
        ("010", "0x0007", 8),
        ("", "0x0007", None),
        ("$NODEID+0x180", "0x0007", 0x185),
        ("0x180 + $NodeID", "0x0007", 0x185),
        ("0x3F800000", "0x0008", 1.0),
        ("0.5", "0x0008", 0.5),
        ("Drive", "0x0009", "Drive"),
        ("48 69", "0x000A", b"Hi"),
        ("whatever", "0x000A", None),
    ],
)
def test_a_default_is_read_as_makers_write_it(default: str, data_type: str, value: object) -> None:
    """Two's complement in hexadecimal, whole decimals, octal numbers, the node-ID on either side, bits of a REAL32."""
    assert entry(default, data_type).default == value


@pytest.mark.parametrize(
    ("default", "data_type", "extra", "said"),
    [
        ("0x1FFFF", "0x0003", "", "[6007] DefaultValue = 0x1FFFF: does not fit an INTEGER16"),
        ("banana", "0x0007", "", "[6007] DefaultValue = banana: is no number, nor $NODEID+number"),
        ("$NODEID*2+0x180", "0x0007", "", "[6007] DefaultValue = $NODEID*2+0x180: is no number, nor $NODEID+number"),
        ("089", "0x0007", "", "[6007] DefaultValue = 089: is no number"),
        ("1,5", "0x0008", "", "[6007] DefaultValue = 1,5: is no REAL32"),
        ("1e99", "0x0008", "", "[6007] DefaultValue = 1e99: is no REAL32"),
        ("0", "3h", "", "[6007] DataType = 3h: is no number"),
        ("0", "", "", "[6007] DataType = : is missing"),
        ("0", "3", "PDOMapping=true\n", "[6007] PDOMapping = true: is no number"),
        ("0", "3", "ParameterValue=x\n", "[6007] ParameterValue = x: is no number"),
        ("0", "3", "[6007]\n", "line 7: the section [6007] is there twice"),
        ("0", "3", "[7130sub1]\nDataType=3\n", "[7130sub1]: there is no section [7130]"),
        ("0", "3", "AccessType=ro\n", "line 7, in [6007]: AccessType is there twice, with two values"),
        ("0", "3", "rubbish\n", "line 7, in [6007]: neither [section] nor entry = value: rubbish"),
    ],
)
def test_a_value_that_cannot_be_is_one_error_with_its_place(
    default: str, data_type: str, extra: str, said: str
) -> None:
    """The section and the entry, or the line, and why."""
    with pytest.raises(EdsError) as caught:
        entry(default, data_type, extra)
    assert said in str(caught.value)


def test_the_error_names_the_file(tmp_path: Path) -> None:
    """File, section and remedy are in one sentence."""
    path = tmp_path / "drive.eds"
    path.write_text(VARIABLE.format(index="6007", data_type="3h", default=0))
    said = r"the EDS file drive\.eds cannot be used: \[6007\] DataType = 3h: is no number\. Correct it there, or take"
    with pytest.raises(DictionaryError, match=said):
        object_dictionary(path)


def test_a_virtual_node_has_the_negative_default(tmp_path: Path) -> None:
    """0xFFFF of an INTEGER16 is uploaded as it is written."""
    path = tmp_path / "drive.eds"
    path.write_text(VARIABLE.format(index="6007", data_type="0x0003", default="0xFFFF"))
    dictionary = Dictionary(path, NODE)
    assert dictionary.get(0x6007) == -1
    assert dictionary.read((0x6007, 0)) == b"\xff\xff"


@pytest.mark.parametrize(
    ("extra", "limits"),
    [
        ("LowLimit=0xFFFE\nHighLimit=2\n", (-2, 2)),
        ("LowLimit=5\nHighLimit=-5\n", (None, None)),
        ("LowLimit=\n", (None, None)),
    ],
)
def test_limits_that_contradict_each_other_are_none(extra: str, limits: tuple[int | None, int | None]) -> None:
    """Makers write 0xFFFF… as the highest value of signed types."""
    found = entry("0", "3", extra)
    assert (found.min, found.max) == limits


def test_names_are_the_same_in_capital_and_small_letters() -> None:
    """Of sections and of entries (CiA 306)."""
    text = VARIABLE.format(index="60fF", data_type="4", default="7").lower() + "[7130]\nOBJECTTYPE=8\n"
    found = parse_eds(text + "[7130SUB1]\nparametername=Value\ndatatype=4\naccesstype=RO\npdomapping=1\n", NODE)
    assert found.get_variable(0x60FF).default == 7
    assert (found.get_variable(0x7130, 1).name, found.get_variable(0x7130, 1).pdo_mappable) == ("Value", True)


COMPACT = "[7130]\nParameterName=Load\nObjectType=0x8\nDataType=0x0004\nAccessType=ro\nPDOMapping=1\nCompactSubObj=4\n"


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ("", ["Load 1", "Load 2", "Load 3", "Load 4"]),
        ("[7130Name]\nNrOfEntries=2\n1=Front\n3=Rear\n", ["Front", "Load 2", "Rear", "Load 4"]),
        ("[7130Name]\nNrOfEntries=0\n", ["Load 1", "Load 2", "Load 3", "Load 4"]),
    ],
)
def test_a_compact_array_has_as_many_entries_as_it_says(names: str, expected: list[str]) -> None:
    """Each as the array is described; `[7130Name]` names none, some or all of them, and there is no fifth."""
    found = parse_eds(COMPACT + names, NODE)
    assert [found.get_variable(0x7130, k).name for k in range(1, 5)] == expected
    assert all(found.get_variable(0x7130, k).pdo_mappable for k in range(1, 5))
    assert found.get_variable(0x7130, 0).default == 4
    assert found.get_variable(0x7130, 5) is None


def test_an_entry_of_a_compact_array_may_have_a_value_and_a_section_of_its_own() -> None:
    """`[7130Value]` of a DCF, and `[7130sub2]`."""
    own = "[7130Value]\nNrOfEntries=1\n1=-5\n[7130sub2]\nParameterName=Other\nDataType=0x0002\nAccessType=rw\n"
    found = parse_eds(COMPACT + own, NODE)
    assert [found.get_variable(0x7130, k).value for k in (1, 3)] == [-5, None]
    assert (found.get_variable(0x7130, 2).name, found.get_variable(0x7130, 2).data_type) == ("Other", 2)


@pytest.mark.parametrize("count", ["255", "-1", "x"])
def test_a_compact_array_of_an_impossible_length_is_an_error(count: str) -> None:
    """The section is named."""
    with pytest.raises(EdsError, match=r"\[7130\] CompactSubObj = "):
        parse_eds(COMPACT.replace("CompactSubObj=4", f"CompactSubObj={count}"), NODE)


def test_compact_pdos_are_those_that_no_section_describes(tmp_path: Path) -> None:
    """As many as [DeviceInfo] says, with the sub-indices of the bits; identifiers of the first four are predefined."""
    described_one = VARIABLE.format(index="1801", data_type="7", default="0").replace("ObjectType=0x7", "ObjectType=9")
    text = "[DeviceInfo]\nCompactPDO=0x13\nNrOfRXPDO=1\nNrOfTXPDO=5\n" + described_one
    path = tmp_path / "compact.eds"
    path.write_text(text)
    assert listed_pdos(path, transmit=True) == [1, 2, 3, 4, 5]
    assert listed_pdos(path, transmit=False) == [1]
    found = parse_eds(text, NODE)
    assert sorted(found[0x1800]) == [0, 1, 2, 5]
    assert [found.get_variable(index, 1).default for index in (0x1400, 0x1800, 0x1802, 0x1804)] == [
        *(0x205, 0x185, 0x385, 0x8000_0000),
    ]
    assert [found.get_variable(index, 1).relative for index in (0x1800, 0x1804)] == [True, False]
    assert list(found[0x1801]) == []
    assert sorted(found[0x1A01]) == list(range(65))
    assert all(found.get_variable(0x1A01, sub).writable for sub in range(65))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_the_encoding_is_recognised(encoding: str) -> None:
    """UTF-8 and UTF-16 with a byte-order mark as well; of Latin-1 only the names suffer."""
    text = decoded(VARIABLE.format(index="6007", data_type="3", default="-7").replace("=x", "=Räder").encode(encoding))
    assert parse_eds(text, NODE).get_variable(0x6007).default == -7
