"""The constants of CiA 301, as the standard prints them."""

from __future__ import annotations

import pytest
from canopen.objectdictionary import datatypes
from canopen.sdo import SdoAbortedError

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import cob_id
from regolithd.drivers.canopen.eds import STRUCT_CODES
from regolithd.drivers.canopen.emcy import emergency_frame, error_text, parse, register_bits
from regolithd.drivers.canopen.nmt import NmtCommand, NmtState, command_frame, parse_state, state_frame
from regolithd.drivers.canopen.sdo import ABORT_TEXTS, abort_request, abort_text
from regolithd.drivers.canopen.sdo_abort import Abort, AbortError

# CiA 301, table 22, in the order of the standard.
ABORT_CODES = {
    0x05030000: "toggle bit",
    0x05040000: "timed out",
    0x05040001: "command specifier",
    0x05040002: "block size",
    0x05040003: "sequence number",
    0x05040004: "CRC",
    0x05040005: "memory",
    0x06010000: "unsupported access",
    0x06010001: "read a write-only",
    0x06010002: "write a read-only",
    0x06020000: "does not exist in the object dictionary",
    0x06040041: "cannot be mapped",
    0x06040042: "exceed the PDO",
    0x06040043: "parameter incompatibility",
    0x06040047: "internal incompatibility",
    0x06060000: "hardware",
    0x06070010: "length of the value",
    0x06070012: "too long",
    0x06070013: "too short",
    0x06090011: "subindex does not exist",
    0x06090030: "invalid value",
    0x06090031: "too high",
    0x06090032: "too low",
    0x06090036: "maximum value is less than minimum",
    0x060A0023: "resource not available",
    0x08000000: "general error",
    0x08000020: "to the application",
    0x08000021: "local control",
    0x08000022: "device state",
    0x08000023: "object dictionary missing",
    0x08000024: "no data",
}
# The same table: the codes that the virtual nodes send.
SENT = {
    "TOGGLE": 0x05030000,
    "COMMAND": 0x05040001,
    "UNSUPPORTED_ACCESS": 0x06010000,
    "WRITE_ONLY": 0x06010001,
    "READ_ONLY": 0x06010002,
    "NO_OBJECT": 0x06020000,
    "NOT_MAPPABLE": 0x06040041,
    "PDO_LENGTH": 0x06040042,
    "HARDWARE": 0x06060000,
    "TOO_LONG": 0x06070012,
    "TOO_SHORT": 0x06070013,
    "NO_SUBINDEX": 0x06090011,
    "INVALID_VALUE": 0x06090030,
    "TOO_HIGH": 0x06090031,
    "TOO_LOW": 0x06090032,
    "GENERAL": 0x08000000,
    "DEVICE_STATE": 0x08000022,
}
# CiA 301, table 26: error classes, and the codes that it defines in full.
EMCY_TEXTS = {
    0x0000: "no error",
    0x1000: "generic error",
    0x2000: "current",
    0x2100: "input side",
    0x2200: "current inside the device",
    0x2300: "output side",
    0x3000: "voltage",
    0x3100: "mains voltage",
    0x3200: "voltage inside the device",
    0x3300: "output voltage",
    0x4000: "temperature",
    0x4100: "ambient temperature",
    0x4200: "device temperature",
    0x5000: "device hardware",
    0x6000: "device software",
    0x6100: "internal software",
    0x6200: "user software",
    0x6300: "data set",
    0x7000: "additional modules",
    0x8000: "monitoring",
    0x8100: "communication",
    0x8110: "CAN overrun",
    0x8120: "error passive",
    0x8130: "heartbeat error",
    0x8140: "bus-off",
    0x8150: "CAN-ID collision",
    0x8200: "protocol",
    0x8210: "too short",
    0x8220: "longer than its mapping",
    0x8240: "SYNC of unexpected length",
    0x8250: "RPDO overdue",
    0x9000: "external error",
    0xF000: "additional functions",
    0xFF00: "device-specific",
}
# CiA 301, table 44: data type, bytes, and whether it has a sign.
DATA_TYPES = {
    0x01: "?",
    0x02: "b",
    0x03: "h",
    0x04: "i",
    0x05: "B",
    0x06: "H",
    0x07: "I",
    0x08: "f",
    0x11: "d",
    0x15: "q",
    0x1B: "Q",
}


@pytest.mark.parametrize("code", ABORT_CODES, ids=hex)
def test_an_abort_code_has_the_meaning_of_cia_301(code: int) -> None:
    """The text of each abort code contains the words of CiA 301."""
    assert ABORT_CODES[code] in abort_text(code)


def test_the_abort_codes_are_those_of_cia_301() -> None:
    """No code is missing or invented; python-canopen lists the same ones, but for CiA 301's later 0x0607001x."""
    assert set(ABORT_TEXTS) == set(ABORT_CODES)
    assert set(SdoAbortedError.CODES) <= set(ABORT_CODES)
    assert {code.name: code.value for code in Abort} == SENT
    assert str(AbortError(Abort.TOO_HIGH)) == "0x06090031 TOO_HIGH"
    assert str(AbortError(Abort.NO_OBJECT)) == "0x06020000 NO_OBJECT"


def test_an_abort_request_has_command_object_and_code() -> None:
    """The client's abort is 0x80, index, sub-index and the code, little-endian."""
    assert abort_request(0x1018, 4, 0x05040001).hex(" ") == "80 18 10 04 01 00 04 05"


@pytest.mark.parametrize("code", EMCY_TEXTS, ids=hex)
def test_an_error_code_has_the_meaning_of_cia_301(code: int) -> None:
    """The class of an error code, and a code that CiA 301 defines in full, are named by the words of CiA 301."""
    assert EMCY_TEXTS[code] in error_text(code)
    unlisted = code | 0x0F
    if unlisted not in EMCY_TEXTS:
        assert error_text(unlisted) == error_text(code & 0xFF00)


@pytest.mark.parametrize("code", [0x0100, 0x7F00, 0xA000, 0xE100])
def test_an_error_code_of_an_unlisted_class_has_that_of_its_first_digit(code: int) -> None:
    """Where the second digit of a class is not listed, the first one decides; other classes are reserved."""
    wanted = {0x0: "no error, or an error is reset", 0x7: "additional modules"}.get(code >> 12, "reserved error class")
    assert error_text(code) == wanted


def test_the_error_register_has_the_bits_of_object_0x1001() -> None:
    """Bit 0 to bit 7 are named in the order of CiA 301, table 48."""
    names = ["generic", "current", "voltage", "temperature", "communication", "profile", "reserved", "manufacturer"]
    assert [register_bits(1 << bit) for bit in range(8)] == [(name,) for name in names]
    assert register_bits(0) == ()
    assert register_bits(0x81) == ("generic", "manufacturer")


def test_an_emergency_is_written_and_read() -> None:
    """Error code, register and five bytes of the manufacturer are at their places, and other lengths are no EMCY."""
    frame = emergency_frame(9, 0x8130, 0x11, b"\1\2\3\4\5")
    assert (frame.can_id, frame.data.hex(" ")) == (0x089, "30 81 11 01 02 03 04 05")
    assert emergency_frame(9, 0, 0).data == bytes(8)
    found = parse(frame._replace(time_ns=7), 9)
    assert found is not None
    assert (found.time_ns, found.node_id, found.code, found.register, found.vendor, found.cleared) == (
        7,
        9,
        0x8130,
        0x11,
        b"\1\2\3\4\5",
        False,
    )
    for size in (0, 7, 9):
        assert parse(Frame(0, 0x089, bytes(size)), 9) is None
    cleared = parse(emergency_frame(9, 0, 0), 9)
    assert cleared is not None
    assert cleared.cleared


def test_the_predefined_connection_set() -> None:
    """The COB-IDs are those of CiA 301, tables 38 and 39."""
    assert (cob_id.NMT, cob_id.SYNC, cob_id.EMCY) == (0x000, 0x080, 0x080)
    assert [cob_id.TPDO + k * cob_id.PDO_STEP for k in range(4)] == [0x180, 0x280, 0x380, 0x480]
    assert [cob_id.RPDO + k * cob_id.PDO_STEP for k in range(4)] == [0x200, 0x300, 0x400, 0x500]
    assert (cob_id.SDO_ANSWER, cob_id.SDO_REQUEST, cob_id.ERROR_CONTROL) == (0x580, 0x600, 0x700)
    assert cob_id.MASTER_NODE_ID == 127


def test_network_management_has_the_bytes_of_cia_301() -> None:
    """Command specifiers and states are those of CiA 301, 7.2.8, and a command is for all nodes unless one is named."""
    commands = {"START": 1, "STOP": 2, "ENTER_PRE_OPERATIONAL": 128, "RESET_NODE": 129, "RESET_COMMUNICATION": 130}
    assert {command.name: command.value for command in NmtCommand} == commands
    assert {state.text: state.value for state in NmtState} == {
        "boot-up": 0,
        "stopped": 4,
        "operational": 5,
        "pre-operational": 127,
    }
    assert command_frame(NmtCommand.RESET_NODE, 5) == Frame(0, 0x000, b"\x81\x05")
    assert command_frame(NmtCommand.START) == Frame(0, 0x000, b"\x01\x00")
    assert state_frame(NmtState.OPERATIONAL, 127) == Frame(0, 0x77F, b"\x05")


def test_a_reported_state_is_one_byte_without_the_toggle_bit() -> None:
    """Bit 7 is node guarding's toggle; other lengths and values are no state."""
    assert parse_state(b"\x85") is NmtState.OPERATIONAL
    assert parse_state(b"\x7f") is NmtState.PRE_OPERATIONAL
    assert parse_state(b"\xff") is NmtState.PRE_OPERATIONAL
    assert [parse_state(data) for data in (b"", b"\x05\x05", b"\x03", b"\x06")] == [None] * 4


def test_data_types_have_the_struct_codes_of_their_size() -> None:
    """Each numeric data type is read with the size and sign of CiA 301, table 44."""
    assert STRUCT_CODES == DATA_TYPES
    assert datatypes.UNSIGNED64 in STRUCT_CODES
