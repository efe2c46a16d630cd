"""Counters of a bus: every lost frame and every error is counted."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, fields


@dataclass(slots=True)
class BusCounters:
    """Counts since the bus was opened; only the bus writes them."""

    received: int = 0  # frames of other nodes
    echoed: int = 0  # our own frames, seen on the bus
    sent: int = 0  # handed to the kernel or the adapter
    batches: int = 0  # wake-ups that brought frames
    largest_batch: int = 0
    kernel_drops: int = 0  # received by the kernel, discarded because the receive queue was full (SO_RXQ_OVFL)
    transmit_retries: int = 0  # ENOBUFS: the transmit queue was full, tried again
    transmit_failures: int = 0  # given up: queue full for too long, or link down
    bus_off: int = 0
    link_down: int = 0
    malformed: int = 0  # not a classic CAN frame at all
    errors: Counter[str] = field(default_factory=Counter)  # error frames by class (linux/can/error.h)

    def as_dict(self) -> dict[str, int]:
        """Return all counts by name, for messages and logs; error frames as `error_…`."""
        flat = {each.name: getattr(self, each.name) for each in fields(self) if each.name != "errors"}
        return flat | {f"error_{name}": count for name, count in self.errors.items()}
