"""Writes `docs/bus.md`: what is on the bus, as the code has it.

python -m regolithd.drivers.reference > docs/bus.md
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.object_dictionary import variable
from regolithd.drivers.canopen.pdo import MEANINGS, Meaning, Pdo, rpdos, tpdos
from regolithd.drivers.master.boot_reason import CURES
from regolithd.drivers.master.bus_load import bus_load
from regolithd.drivers.master.configuration import Write, configuration
from regolithd.drivers.master.status import NetworkSettings
from regolithd.drivers.signals import NodeDescription, NodeKind

if TYPE_CHECKING:
    from collections.abc import Iterator

_NODES = {NodeKind.MOTOR: "1–6", NodeKind.LOAD_CELL: "11–16", NodeKind.INCLINOMETER: "21", NodeKind.GROUND_SPEED: "22"}
_INTRODUCTION = """# The bus

<!-- Written by `python -m regolithd.drivers.reference`; a test holds it to the code. -->

1 Mbit/s, 11-bit identifiers, CANopen. The daemon is node 127: it produces SYNC (0x080) and a heartbeat, and boots all
others. Node-IDs are those of `rover.toml`; below stand its defaults, *id* being the node's own."""
_ANOTHER_DEVICE = """## Another device

1. Put its own EDS file in place of `drivers/devices/eds/KIND.eds`: identity (0x1000, 0x1018), types and rights are its.
2. Where its objects are others, change the layout and the meaning in `drivers/canopen/pdo.py`. A layout that the EDS
   does not allow – no such object, not mappable, more than 8 bytes – is refused when the daemon starts.
3. `regolithd check` asks every node who it is, and changes nothing."""


def document() -> str:
    """Return the whole document."""
    parts = [_INTRODUCTION, *_pdos(), *_load(), *_booting(), *_reasons(), _ANOTHER_DEVICE]
    return "\n\n".join(parts) + "\n"


def _pdos() -> Iterator[str]:
    yield "## What travels"
    rows = ["| node | PDO | identifier | bytes | object | name | is |", "|---|---|---|---|---|---|---|"]
    for kind in NodeKind:
        for pdo in (*tpdos(kind, diagnostics=True), *rpdos(kind)):
            rows += _pdo_rows(kind, pdo)
    yield "\n".join(rows)
    yield (
        "TPDOs are sent at every SYNC, RPDOs are obeyed at once. TPDO 2 of a motor is for `motor_diagnostics`. "
        "A status that is not 0 means that the PDO measures nothing: its value is missing, not zero."
    )


def _pdo_rows(kind: NodeKind, pdo: Pdo) -> Iterator[str]:
    start = 0
    name = f"{'T' if pdo.transmit else 'R'}PDO {pdo.number}"
    for mapped in pdo.mapping:
        index, subindex, size = mapped >> 16, mapped >> 8 & 0xFF, (mapped & 0xFF) // 8
        meaning = MEANINGS.get((kind, index, subindex))
        says = "command"
        if pdo.transmit:
            says = f"`{meaning.quantity}` = raw × {meaning.factor:.6g}" if isinstance(meaning, Meaning) else "status"
        yield (
            f"| {kind.value} {_NODES[kind]} | {name} | 0x{pdo.cob_id(0):03X} + *id* | {start}–{start + size - 1} "
            f"| 0x{index:04X}:{subindex:02X} | {variable(kind, index, subindex).name} | {says} |"
        )
        start += size


def _load() -> Iterator[str]:
    yield "## How full it is"
    nodes = [NodeDescription(first, kind, None) for kind in NodeKind for first in range(_count(kind))]
    rows = ["| SYNC | 1 Mbit/s | 500 kbit/s | 250 kbit/s |", "|---|---|---|---|"]
    for rate_Hz in (2, 10, 50, 100, 200):
        shares = [bus_load(nodes, sync_rate_Hz=rate_Hz, bitrate=rate) for rate in (1_000_000, 500_000, 250_000)]
        rows.append(f"| {rate_Hz} Hz | " + " | ".join(f"{share:.0%}" for share in shares) + " |")
    yield "\n".join(rows)
    yield "All fourteen nodes, worst-case stuffing, heartbeats included; above about 80 % frames come late."


def _count(kind: NodeKind) -> int:
    return 6 if "–" in _NODES[kind] else 1


def _booting() -> Iterator[str]:
    yield "## What a node is told while it boots"
    yield "In this order, each read back; what differs ends the boot. *keep*: written only where it is not so already."
    for kind in NodeKind:
        rows = ["| object | name | value | |", "|---|---|---|---|"]
        for write, of_next in zip(_writes(kind, 0), _writes(kind, 1), strict=True):
            how = "compared" if write.read_only else "keep" if write.keep else ""
            name = variable(kind, write.index, write.subindex).name
            value = f"0x{write.value:X}" + (" + *id*" if of_next != write else "")
            rows.append(f"| 0x{write.index:04X}:{write.subindex:02X} | {name} | {value} | {how} |")
        yield f"### {kind.value}\n\n" + "\n".join(rows)


def _writes(kind: NodeKind, node_id: int) -> tuple[Write, ...]:
    settings = NetworkSettings(nodes=())
    return configuration(
        NodeDescription(node_id, kind, None),
        heartbeat_s=settings.node_heartbeat_s,
        master_id=settings.master_id,
        master_lost_after_s=settings.master_lost_after_s,
    )


def _reasons() -> Iterator[str]:
    yield "## Why a node does not boot"
    rows = ["| reason | cure |", "|---|---|"]
    rows += [f"| `{reason}` | {cure} |" for reason, cure in CURES.items()]
    yield "\n".join(rows)


if __name__ == "__main__":
    sys.stdout.write(document())
