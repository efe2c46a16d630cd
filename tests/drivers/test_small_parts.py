"""The small pure parts: errors, schedule, error frames, PDO layouts, emergencies, configuration."""

from __future__ import annotations

import asyncio
import builtins
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.drivers import errors, reference
from regolithd.drivers.can.bus import BusState
from regolithd.drivers.can.counters import BusCounters
from regolithd.drivers.can.error_frame import error_classes, reported_state
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import pdo
from regolithd.drivers.canopen.emcy import error_text
from regolithd.drivers.canopen.sync import SyncCounters
from regolithd.drivers.condition import Watch
from regolithd.drivers.errors import BusDownError, DictionaryError, DriverError, SdoTimeoutError
from regolithd.drivers.master.bus_load import bus_load, frame_bits
from regolithd.drivers.master.configuration import configuration
from regolithd.drivers.signals import NodeDescription, NodeKind
from regolithd.drivers.virtual.rover import KAPVIK


def test_a_message_says_where_what_and_the_cure() -> None:
    """In that order, and only what is known."""
    error = SdoTimeoutError("no answer within 0.5 s", node_id=3, index=0x1018, subindex=1, cure="Is it powered?")
    assert str(error) == "node 3, object 0x1018:01: no answer within 0.5 s. Is it powered?"
    assert str(BusDownError("vcan0: cannot send")) == "vcan0: cannot send"


def test_the_tree_that_is_drawn_is_the_tree_that_is() -> None:
    """Each error of the module stands in its docstring, is a `DriverError`, and the standard error drawn beside it."""
    for name, error in vars(errors).items():
        if not (isinstance(error, type) and issubclass(error, DriverError)):
            continue
        found = re.search(rf"^[ │├└─]*{name}(?: \((\w+)\))?(?:  |$)", errors.__doc__ or "", re.MULTILINE)
        assert found, f"{name} is not drawn"
        if found[1]:
            assert issubclass(error, getattr(builtins, found[1])), found[0]


async def test_a_wait_that_is_given_up_leaves_nothing_behind() -> None:
    """Months of waiting for a silent node fill no list; a wait that is fulfilled ends."""
    watch, seen = Watch(), []
    for _ in range(50):
        assert not await watch.until(lambda: bool(seen), 0.001)
    assert watch._waiting == []
    waiting = asyncio.ensure_future(watch.until(lambda: bool(seen), 20.0))
    await asyncio.sleep(0)
    watch.notify()  # not yet true
    await asyncio.sleep(0)
    seen.append(1)
    watch.notify()
    assert await waiting
    assert watch._waiting == []


def test_jitter_is_the_spread_of_the_lateness() -> None:
    """Mean, worst and standard deviation of three."""
    counters = SyncCounters()
    for late in (100, 200, 600):
        counters.count(late)
    assert (counters.produced, counters.worst_late_ns, counters.mean_late_ns) == (3, 600, 300.0)
    assert counters.jitter_ns == pytest.approx(216.02469)


def test_counters_are_flat_numbers() -> None:
    """As messages want them; error frames by class beside the rest."""
    counters = BusCounters(received=3, kernel_drops=2)
    counters.errors.update(["bus-off", "bus-off"])
    flat = counters.as_dict()
    assert (flat["received"], flat["kernel_drops"], flat["error_bus-off"]) == (3, 2, 2)
    assert "errors" not in flat


@pytest.mark.parametrize(
    ("can_id", "data", "classes", "state"),
    [
        (0x040, bytes(8), ["bus-off"], BusState.OFF),
        (0x100, bytes(8), ["restarted"], BusState.ACTIVE),
        (0x004, b"\0\x08\0\0\0\0\x80\0", ["controller"], BusState.WARNING),
        (0x004, b"\0\x20\0\0\0\0\x90\0", ["controller"], BusState.PASSIVE),
        (0x004, b"\0\x01\0\0\0\0\0\0", ["controller", "receive-overflow"], None),
        (0x004, b"\0\x40\0\0\0\0\0\0", ["controller"], BusState.ACTIVE),
        (0x088, bytes(8), ["protocol", "bus-error"], None),
        (0x020, bytes(8), ["no-acknowledge"], None),
        (0x004, b"", ["controller"], None),
    ],
)
def test_an_error_frame_is_counted_and_says_the_state(
    can_id: int, data: bytes, classes: list[str], state: BusState | None
) -> None:
    """By the bits of linux/can/error.h."""
    frame = Frame(0, can_id, data, error=True)
    assert error_classes(frame) == classes
    assert reported_state(frame) is state


def test_a_layout_is_checked_against_the_eds() -> None:
    """What the EDS lacks, what it does not allow, and what does not fit are refused, with the object named."""
    for entries, what in (
        (((0x6123, 0),), "no such object"),
        (((0x1017, 0),), "may not be mapped"),
        (((0x606C, 0), (0x60FF, 0), (0x6041, 0)), "a frame carries 8"),
    ):
        with pytest.raises(DictionaryError, match=what):
            pdo._compile(NodeKind.MOTOR, pdo.Layout(1, entries), transmit=True)


def test_every_mapped_measurement_has_a_meaning() -> None:
    """Nothing travels that nobody understands."""
    for kind in NodeKind:
        for each in pdo.tpdos(kind, diagnostics=True):
            assert None not in each.meanings
            assert each.transmission_type == 1


def test_a_pdo_is_set_up_in_the_standard_s_order() -> None:
    """Off, type, count 0, entries, count, on – and what is not used is off."""
    writes = configuration(
        NodeDescription(3, NodeKind.MOTOR, 2), heartbeat_s=0.2, master_id=127, master_lost_after_s=0.5
    )
    first = [(write.index, write.subindex, write.value) for write in writes if write.index in (0x1800, 0x1A00)]
    assert first == [
        (0x1800, 1, 0x80000000),
        (0x1800, 2, 1),
        (0x1A00, 0, 0),
        (0x1A00, 1, 0x60410010),
        (0x1A00, 2, 0x60780010),
        (0x1A00, 3, 0x606C0020),
        (0x1A00, 0, 3),
        (0x1800, 1, 0x183),
    ]
    unused = [write.index for write in writes if write.subindex == 1 and write.keep]
    assert {0x1801, 0x1802, 0x1803, 0x1401, 0x1402, 0x1403} <= set(unused)
    assert (0x1016, 1, 127 << 16 | 500) in [(write.index, write.subindex, write.value) for write in writes]


def test_units_are_set_or_compared() -> None:
    """A sensor that measures in another unit is refused, not misread."""
    of = {
        kind: configuration(NodeDescription(9, kind, 0), heartbeat_s=0.2, master_id=127, master_lost_after_s=0.5)
        for kind in NodeKind
    }
    resolution = next(write for write in of[NodeKind.INCLINOMETER] if write.index == 0x6000)
    assert (resolution.value, resolution.read_only) == (10, False)
    digits = next(write for write in of[NodeKind.LOAD_CELL] if write.index == 0x6132)
    assert (digits.value, digits.read_only) == (2, True)


def test_the_load_of_the_bus_is_known_beforehand() -> None:
    """Worst-case bits by the published formula; Kapvik's fourteen nodes at 100 Hz take a fifth of 1 Mbit/s."""
    assert [frame_bits(size) for size in (0, 1, 8)] == [55, 65, 135]
    share = bus_load(KAPVIK, sync_rate_Hz=100.0, bitrate=1_000_000)
    assert share == pytest.approx((55 + 6 * 135 + 6 * 105 + 115 + 105) * 100e-6 + 65 * 80e-6)
    assert bus_load(KAPVIK, sync_rate_Hz=200.0, bitrate=125_000) > 1.0


def test_a_valid_pdo_keeps_its_identifier_while_it_is_switched_off() -> None:
    """CiA 301 forbids to change it and bit 31 at once."""
    off = configuration(
        NodeDescription(3, NodeKind.LOAD_CELL, 2), heartbeat_s=0.2, master_id=127, master_lost_after_s=0.5
    )[2]
    assert off.data(present=0x40000183) == (0xC0000183).to_bytes(4, "little")


def test_error_codes_are_words() -> None:
    """The maker's words for its own device, else CiA 301's, else the class's."""
    assert "undervoltage" in error_text(0x3220, NodeKind.MOTOR)
    assert error_text(0x3220) == "voltage inside the device"
    assert "heartbeat" in error_text(0x8130)
    assert error_text(0x5001) == "device hardware"
    assert error_text(0xA000) == "reserved error class"
    assert error_text(0x0000) == "no error, or an error is reset"


@given(st.integers(0, 0xFFFF))
def test_every_code_has_words(code: int) -> None:
    """All of them."""
    assert error_text(code)
    assert error_text(code, NodeKind.MOTOR)


def test_the_document_of_the_bus_is_what_the_code_does() -> None:
    """`docs/bus.md` is written by `python -m regolithd.drivers.reference`; write it anew where this fails."""
    written = Path(__file__).parents[2] / "docs" / "bus.md"
    assert written.read_text() == reference.document()
