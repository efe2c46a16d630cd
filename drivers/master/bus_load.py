"""Worst-case bus load, computed before a SYNC rate is chosen.

A classic frame with an 11-bit identifier and n data bytes takes at most 8n + 47 + ⌊(34 + 8n − 1)/4⌋ bits, stuff bits
and the space to the next frame included (Davis et al., "Controller Area Network (CAN) schedulability analysis", 2007).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.drivers.devices.decoding.pdo import tpdos

if TYPE_CHECKING:
    from collections.abc import Iterable

    from regolithd.drivers.devices.node import NodeDescription

HEARTBEAT_BYTES = 1


def frame_bits(data_bytes: int) -> int:
    """Return the highest number of bits that a frame takes on the bus."""
    data_bits = 8 * data_bytes
    return data_bits + 47 + (34 + data_bits - 1) // 4


def bus_load(
    nodes: Iterable[NodeDescription],
    *,
    sync_rate_Hz: float,
    bitrate: int,
    node_heartbeat_s: float = 0.2,
    master_heartbeat_s: float = 0.1,
) -> float:
    """Return the highest bus load (1.0: fully loaded) with every node operational."""
    described = tuple(nodes)
    per_sync = frame_bits(0)
    for node in described:
        per_sync += sum(frame_bits(pdo.layout.size) for pdo in tpdos(node.device, diagnostics=node.diagnostics))
    heartbeats_Hz = len(described) / node_heartbeat_s + 1.0 / master_heartbeat_s
    return (per_sync * sync_rate_Hz + frame_bits(HEARTBEAT_BYTES) * heartbeats_Hz) / bitrate
