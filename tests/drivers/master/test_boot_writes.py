"""How the master writes one object while a node boots: what it reads first, what it leaves, what it finds wrong."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.errors import SdoAbortError
from regolithd.drivers.master.boot import BootSettings, _Boot
from regolithd.drivers.master.boot_configuration import Write
from regolithd.drivers.master.boot_error import BootError, BootReason

INDEX, SUB = 0x1800, 1
VALID = 0x8000_0000


class Sdo:
    """A node's one object, which keeps what is written, or only some bits of it."""

    def __init__(self, present: int, kept: int = 0xFFFF_FFFF) -> None:
        self.present, self.kept = present, kept
        self.reads, self.written = 0, []  # type: ignore[var-annotated]

    async def read_number(self, index: int, subindex: int, *, signed: bool = False) -> int:
        """Return the value."""
        assert (index, subindex, signed) == (INDEX, SUB, False)
        self.reads += 1
        return self.present

    async def write(self, index: int, subindex: int, data: bytes) -> None:
        """Keep the value, as far as the node can."""
        assert (index, subindex, len(data)) == (INDEX, SUB, 4)
        self.written.append(int.from_bytes(data, "little"))
        self.present = self.written[-1] & self.kept


def booting(sdo: Any) -> _Boot:
    """Return the boot process of load cell 11."""
    remote: Any = SimpleNamespace(node=NodeDescription(11, LOAD_CELL, 0), sdo=sdo, boot_ups=1, stated={})
    settings = BootSettings(heartbeat_s=0.5, master_id=127, master_lost_after_s=1.5, boot_up_timeout_s=1.0)
    return _Boot(remote, settings)


def write(value: int, mask: int = 0xFFFF_FFFF, **options: Any) -> Write:
    """Return a write of four bytes."""
    return Write(INDEX, SUB, value, mask, 4, **options)


@pytest.mark.parametrize(
    ("wanted", "before", "written", "reads"),
    [
        (write(0x181), 0x181, [0x181], 1),
        (write(0x181), 0x281, [0x181], 1),
        (write(0x181, keep=True), 0x181, [], 1),
        (write(0x181, keep=True), 0x182, [0x181], 2),
        (write(0x181, 0x7FF, keep=True), 0x4000_0181, [], 1),
        (write(0x181, 0x7FF, keep=True), 0x4000_0182, [0x4000_0181], 2),
        (write(0x10, 0xF0, keep=True), 0x1F, [], 1),
        (write(VALID | 0x181, VALID | 0x7FF, keep=True), 0x181, [VALID | 0x181], 2),
        (write(0x181, read_only=True), 0x181, [], 1),
        (write(0x181, 0x7FF, read_only=True), 0x4000_0181, [], 1),
        (write(0x281, keep=True, lock=(VALID, VALID)), 0x181, [VALID | 0x181, 0x281], 2),
        (write(0x281, keep=True, lock=(VALID, VALID)), VALID | 0x181, [0x281], 2),
        (write(VALID | 0x181, keep=True, lock=(VALID, VALID)), 0x181, [VALID | 0x181], 2),
    ],
)
async def test_an_object_is_written_where_it_is_not_right_already(
    wanted: Write, before: int, written: list[int], reads: int
) -> None:
    """Bits outside the mask stay; an identifier is moved while its service is off; what was written is read back."""
    sdo = Sdo(before)
    await booting(sdo)._write(wanted)
    assert (sdo.written, sdo.reads) == (written, reads)


@pytest.mark.parametrize(
    ("wanted", "kept", "reason", "told"),
    [
        (write(0x181), 0x0FF, BootReason.CONFIGURATION_NOT_KEPT, "was set to 0x181, and reads 0x81"),
        (write(0x1FF, 0x0F0, keep=True), 0x00F, BootReason.CONFIGURATION_NOT_KEPT, "was set to 0xF0, and reads 0x0"),
        (write(0x181, read_only=True), 0, BootReason.FIXED_OTHERWISE, "cannot be written, must be 0x181, .* 0x500"),
    ],
)  # fmt: skip
async def test_an_object_that_is_not_kept_ends_the_boot(
    wanted: Write, kept: int, reason: BootReason, told: str
) -> None:
    """The error has node, object and both values."""
    with pytest.raises(BootError, match=told) as error:
        await booting(Sdo(0x500, kept))._write(wanted)
    assert (error.value.reason, error.value.node_id) == (reason, 11)
    assert (error.value.index, error.value.subindex) == (INDEX, SUB)


async def test_an_object_that_is_refused_ends_the_boot() -> None:
    """With the object."""

    class Refusing(Sdo):
        async def read_number(self, index: int, subindex: int, *, signed: bool = False) -> int:  # noqa: ARG002
            raise SdoAbortError(0x0602_0000, "no such object", node_id=11, index=index, subindex=subindex)

    with pytest.raises(BootError) as error:
        await booting(Refusing(0))._configure()
    assert error.value.reason is BootReason.CONFIGURATION_REFUSED
    assert error.value.node_id == 11
    assert error.value.index
