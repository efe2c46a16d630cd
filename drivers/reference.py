"""Writes `docs/reference/bus.md`: identifiers, PDOs, boot configuration and bus load, from the device registry.

python -m regolithd.drivers.reference > docs/reference/bus.md
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.object_dictionary import variable
from regolithd.drivers.devices.decoding.pdo import rpdos, tpdos
from regolithd.drivers.devices.device import Commanded, Measured
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.devices.registry import DEVICES
from regolithd.drivers.master.boot_configuration import Write, boot_writes
from regolithd.drivers.master.boot_error import REMEDIES
from regolithd.drivers.master.bus_load import bus_load
from regolithd.drivers.master.status import NetworkSettings
from regolithd.drivers.virtual.rover import KAPVIK

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.drivers.devices.decoding.pdo import DevicePdo
    from regolithd.drivers.devices.device import Device, PdoObject

_INTRODUCTION = """# The bus

<!-- Written by `python -m regolithd.drivers.reference`; a test holds it to the code. -->

1 Mbit/s, 11-bit identifiers, CANopen. The daemon is node 127: it produces SYNC (0x080) and a heartbeat, and boots all
others. The node-IDs are set in `rover.toml`; below are the defaults, *id* being the node's own."""
_ANOTHER_DEVICE = """## Another device

Of a kind that is listed above: describe it in `rover.toml`, table `[devices]` (docs/how-to/devices.md). Nothing is
programmed.

Of a new kind:

1. Write `drivers/devices/KIND.py`, as `inclinometer.py` does: its quantities, its virtual device, and one `Device`.
2. Add it to `DEVICES` in `drivers/devices/registry.py`.

Boot configuration, decoding, the key in `rover.toml`, snapshots, MQTT messages, recordings, exports, the virtual rover
and this document follow from it."""


def document() -> str:
    """Return the whole document."""
    parts = [_INTRODUCTION, *_pdos(), *_load(), *_booting(), *_reasons(), _ANOTHER_DEVICE]
    return "\n\n".join(parts) + "\n"


def _pdos() -> Iterator[str]:
    yield "## PDOs"
    rows = ["| node | PDO | identifier | bytes | object | name | meaning |", "|---|---|---|---|---|---|---|"]
    for device in DEVICES:
        for pdo in (*tpdos(device, diagnostics=True), *rpdos(device)):
            rows += _pdo_rows(device, pdo)
    yield "\n".join(rows)
    yield (
        "TPDOs are sent at every SYNC, RPDOs take effect at once. TPDO 2 of a motor is for `motor_diagnostics`. "
        "Where a status is not 0, the PDO holds no valid measurement: its value is missing, not zero."
    )


def _pdo_rows(device: Device, pdo: DevicePdo) -> Iterator[str]:
    start = 0
    name = f"{'T' if pdo.transmit else 'R'}PDO {pdo.number}"
    for mapped, each in zip(pdo.mapping, pdo.objects, strict=True):
        size = (mapped & 0xFF) // 8
        yield (
            f"| {device.kind} {_node_ids(device)} | {name} | 0x{pdo.cob_id(0):03X} + *id* | {start}–{start + size - 1} "
            f"| 0x{each.index:04X}:{each.subindex:02X} | {variable(device.eds, each.index, each.subindex).name} "
            f"| {_meaning(each)} |"
        )
        start += size


def _meaning(each: PdoObject) -> str:
    if isinstance(each, Measured):
        return f"`{each.quantity.name}` = raw × {each.scale:.6g}"
    return "command" if isinstance(each, Commanded) else "status"


def _node_ids(device: Device) -> str:
    first = device.default_node_id
    return f"{first}–{first + 5}" if device.per_wheel else str(first)


def _load() -> Iterator[str]:
    yield "## Bus load"
    rows = ["| SYNC | 1 Mbit/s | 500 kbit/s | 250 kbit/s |", "|---|---|---|---|"]
    for rate_Hz in (2, 10, 50, 100, 200):
        shares = [bus_load(KAPVIK, sync_rate_Hz=rate_Hz, bitrate=rate) for rate in (1_000_000, 500_000, 250_000)]
        rows.append(f"| {rate_Hz} Hz | " + " | ".join(f"{share:.0%}" for share in shares) + " |")
    yield "\n".join(rows)
    yield f"All {len(KAPVIK)} nodes, worst-case stuffing, heartbeats included; above about 80 % frames come late."


def _booting() -> Iterator[str]:
    yield "## Boot configuration"
    yield "Written in this order, each read back; a difference ends the boot. *keep*: written only where it differs."
    for device in DEVICES:
        rows = ["| object | name | value | |", "|---|---|---|---|"]
        for write, of_next in zip(_writes(device, 0), _writes(device, 1), strict=True):
            how = "compared" if write.read_only else "keep" if write.keep else ""
            name = variable(device.eds, write.index, write.subindex).name
            value = f"0x{write.value:X}" + (" + *id*" if of_next != write else "")
            rows.append(f"| 0x{write.index:04X}:{write.subindex:02X} | {name} | {value} | {how} |")
        yield f"### {device.kind}\n\n" + "\n".join(rows)


def _writes(device: Device, node_id: int) -> tuple[Write, ...]:
    settings = NetworkSettings(nodes=())
    return boot_writes(
        NodeDescription(node_id, device, None),
        heartbeat_s=settings.node_heartbeat_s,
        master_id=settings.master_id,
        master_lost_after_s=settings.master_lost_after_s,
    )


def _reasons() -> Iterator[str]:
    yield "## Boot errors"
    rows = ["| reason | remedy |", "|---|---|"]
    rows += [f"| `{reason}` | {remedy} |" for reason, remedy in REMEDIES.items()]
    yield "\n".join(rows)


if __name__ == "__main__":
    sys.stdout.write(document())
