"""What the trial of a boot configuration reads, with a device that answers as a test wants."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from regolithd.drivers.devices.device import Measured, PdoLayout, Quantity
from regolithd.drivers.errors import SdoAbortError
from regolithd.drivers.master import trial
from regolithd.drivers.master.boot_configuration import Write

NO_OBJECT, WRITE_ONLY = 0x0602_0000, 0x0601_0001


class Device:
    """An SDO client whose device has some objects, and others that may only be written."""

    def __init__(self, values: dict[tuple[int, int], bytes], write_only: tuple[int, ...] = ()) -> None:
        self.values, self.write_only = values, write_only
        self.reads: list[tuple[int, int]] = []

    async def read(self, index: int, subindex: int) -> bytes:
        """Return a value."""
        self.reads.append((index, subindex))
        if (index, subindex) not in self.values:
            code = WRITE_ONLY if index in self.write_only else NO_OBJECT
            raise SdoAbortError(code, "aborted", node_id=3, index=index, subindex=subindex)
        return self.values[index, subindex]


def layout(index: int, *, diagnostic: bool = False) -> PdoLayout:
    """Return a PDO with one object."""
    return PdoLayout(1, (Measured(index, 0, Quantity("x"), 1.0),), diagnostic=diagnostic)


@pytest.mark.parametrize(("diagnostics", "wanted"), [(False, [0x6064, 0x6042]), (True, [0x2000, 0x6064, 0x6042])])
async def test_what_is_mapped_is_read_without_the_diagnostics_that_are_off(
    diagnostics: bool, wanted: list[int]
) -> None:
    """Those of PDOs after a diagnostic one too; an object that may only be written is there."""
    device = Device({}, write_only=(0x6042,))
    described = SimpleNamespace(tpdos=(layout(0x2000, diagnostic=True), layout(0x6064)), rpdos=(layout(0x6042),))
    remote: Any = SimpleNamespace(node=SimpleNamespace(device=described, diagnostics=diagnostics), sdo=device)
    told = [text async for text in trial._mapped(remote)]
    assert [index for index, _ in device.reads] == wanted
    absent = [index for index in wanted if index != 0x6042]
    assert told == [f"0x{index:04X}:00 is to be mapped, and the device does not have it" for index in absent]


async def test_what_is_written_is_compared_object_by_object() -> None:
    """Size always, the value where booting does not write it; of an object that is missing, one line."""
    device = Device({(0x1017, 0): b"\1\0", (0x1018, 1): b"\5\0\0\0", (0x6060, 0): b"\3\0"}, write_only=(0x1010,))
    writes = (
        Write(0x1600, 1, 0, 0xFF, 1),
        Write(0x1600, 2, 0, 0xFF, 1),
        Write(0x1010, 1, 0, 0xFFFF_FFFF, 4),
        Write(0x1017, 0, 500, 0xFFFF, 2),
        Write(0x1018, 1, 4, 0xFFFF_FFFF, 4, read_only=True),
        Write(0x6060, 0, 3, 0xFF, 1),
    )
    remote: Any = SimpleNamespace(sdo=device)
    told = [text async for text in trial._compared(remote, writes)]
    assert told[0] == "0x1600:01 is in the EDS, and the device does not have it (abort 0x06020000)"
    assert told[1].startswith("0x1018:01 ")
    assert told[2] == "0x6060:00 has 8 bits in the EDS, and 16 in the device"
    assert len(told) == 3
    assert (0x1600, 2) not in device.reads
