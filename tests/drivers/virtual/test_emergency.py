"""The virtual nodes' EMCY producer, object values, and commands of fault injection."""

from __future__ import annotations

from copy import copy

import pytest
from virtual_master import Master

from regolithd.drivers.virtual.emcy import EmergencyProducer
from regolithd.drivers.virtual.object_dictionary import Dictionary
from regolithd.drivers.virtual.rover import KAPVIK

NODE = 11


def emergencies(codes: list[int]) -> tuple[list[str], Dictionary]:
    """Raise errors on a load cell; return the data of the frames, and its objects."""
    description = next(each for each in KAPVIK if each.node_id == NODE)
    sent: list[str] = []
    dictionary = Dictionary(description.device.eds, NODE)
    producer = EmergencyProducer(dictionary, lambda can_id, data: sent.append(f"{can_id:03x} {data.hex()}"))
    for code in codes:
        producer.set(code)
    return sent, dictionary


@pytest.mark.parametrize(
    ("code", "register"),
    [(0x1000, 0x01), (0x2310, 0x03), (0x3220, 0x05), (0x4210, 0x09), (0x8130, 0x11), (0xFF01, 0x81), (0x5000, 0x01)],
)
def test_the_error_register_follows_the_class_of_the_error(code: int, register: int) -> None:
    """Current, voltage, temperature, communication and manufacturer-specific have a bit each, besides bit 0."""
    sent, dictionary = emergencies([code])
    assert sent == [f"08b {code & 0xFF:02x}{code >> 8:02x}{register:02x}0000000000"]
    assert dictionary.get(0x1001) == register


def test_the_error_history_has_the_last_eight_errors_the_newest_first() -> None:
    """0x1003:00 is their number; bits of all present errors are in the register."""
    codes = [0x2300 + number for number in range(10)] + [0x3210]
    sent, dictionary = emergencies([*codes, codes[0]])
    assert len(sent) == 11  # an error that is present is not sent again
    assert dictionary.get(0x1003) == 8
    assert [dictionary.get(0x1003, sub) for sub in range(1, 9)] == codes[:2:-1]
    assert dictionary.get(0x1001) == 0x07


def test_an_emergency_with_its_cob_id_disabled_is_kept_but_not_sent() -> None:
    """Bit 31 of 0x1014 disables the message; history and register are written."""
    description = next(each for each in KAPVIK if each.node_id == NODE)
    sent: list[int] = []
    dictionary = Dictionary(description.device.eds, NODE)
    producer = EmergencyProducer(dictionary, lambda can_id, _data: sent.append(can_id))
    dictionary.put(0x1014, 0, 0x8000_008B)
    producer.set(0x5000)
    assert (sent, dictionary.get(0x1003, 1), dictionary.get(0x1001)) == ([], 0x5000, 1)
    dictionary.put(0x1014, 0, 0x0000_0091)
    producer.clear(0x6000)  # not present
    assert sent == []
    producer.clear(0x5000)
    assert (sent, dictionary.get(0x1001), producer.active) == ([0x091], 0, [])


@pytest.mark.parametrize(
    ("index", "sub", "given", "kept"),
    [
        (0x6041, 0, 0x1_2345, 0xFFFF),
        (0x6041, 0, -1, 0),
        (0x606C, 0, 1 << 40, 0x7FFF_FFFF),
        (0x606C, 0, -(1 << 40), -(1 << 31)),
        (0x6078, 0, 32767, 32767),
        (0x6078, 0, 32768, 32767),
        (0x6078, 0, -32768, -32768),
        (0x6078, 0, -32769, -32768),
    ],
)
def test_a_value_outside_its_type_is_clipped(index: int, sub: int, given: int, kept: int) -> None:
    """A device that measures more than its object can hold reports the largest value."""
    dictionary = Dictionary(KAPVIK[0].device.eds, 1)
    dictionary.put(index, sub, given)
    assert dictionary.get(index, sub) == kept


def test_a_string_is_no_number() -> None:
    """Reading it as one is a bug, and raises."""
    with pytest.raises(TypeError, match="0x1008:00 is a string"):
        Dictionary(KAPVIK[0].device.eds, 1).get(0x1008)


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("", ""),
        ("loud 3", "error: there is no command 'loud'; `help` lists them"),
        ("off", "error: a number is expected, and none was given"),
        ("off three", "error: a number is expected, not 'three'"),
        ("emcy 3", "error: a number is expected, and none was given"),
        ("slow 3 soon", "error: a number is expected, not 'soon'"),
        ("off 99", "error: there is no node 99; there are 1, 2, 3, 4, 5, 6, 11, 12, 13, 14, 15, 16, 21, 22"),
        ("fault 11 0x1000", "error: node 11 is not a drive"),
        ("identity 3", "error: which entry of the identity? One of vendor, product, revision, serial"),
        ("identity 3 colour 5", "error: which entry of the identity? One of vendor, product, revision, serial"),
        ("identity 3 vendor", "error: a number is expected, and none was given"),
    ],
)
def test_a_wrong_command_is_answered_by_what_is_expected(line: str, answer: str) -> None:
    """An incomplete or unknown command changes nothing, and its answer names the part that is wrong."""
    assert Master().rover.inject_fault(line) == answer


@pytest.mark.parametrize(
    ("line", "name", "value"),
    [
        ("slow 11 30", "delay_ns", 30_000_000),
        ("short 11 2", "missing_bytes", 2),
        ("status 11 0x4", "status", 4),
        ("no-boot-up 11", "no_boot_up", True),
        ("no-heartbeat 11", "no_heartbeat", True),
        ("no-sdo 11", "no_sdo", True),
        ("refuse 11 0x1A00", "refused", {0x1A00}),
        ("forget 11 0x1800", "forgotten", {0x1800}),
        ("identity 11 vendor 1", "identity", {1: 1}),
        ("identity 11 serial 0x10", "identity", {4: 16}),
    ],
)
def test_a_fault_has_its_unit_and_is_none_at_first(line: str, name: str, value: object) -> None:
    """The command sets one fault of one node, `all` that of every node, and `clear` ends it."""
    master = Master()
    fresh = copy(getattr(master.node(12).faults, name))
    assert not fresh
    assert master.rover.inject_fault(line) == "ok"
    assert getattr(master.node(11).faults, name) == value
    assert getattr(master.node(12).faults, name) == fresh
    assert master.rover.inject_fault(line.replace("11", "all", 1)) == "ok"
    assert getattr(master.node(12).faults, name) == value
    assert master.rover.inject_fault("clear all") == "ok"
    assert getattr(master.node(11).faults, name) == fresh


def test_writing_zero_to_the_error_history_clears_it() -> None:
    """CiA 301, 7.5.2.4: the number of errors and every entry; the errors themselves stay."""
    master = Master()
    node = master.node(NODE)
    node._emergency.set(0x2310)
    node._emergency.set(0x3210)
    assert master.read(NODE, 0x1003, 0) == 2
    master.write(NODE, 0x1003, 0, 0, 1)
    assert [master.read(NODE, 0x1003, sub) for sub in range(3)] == [0, 0, 0]
    assert master.read(NODE, 0x1001, 0) == 0x07
