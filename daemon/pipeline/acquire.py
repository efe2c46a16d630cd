"""From decoded frames to snapshots: a pure function of the frame stream, so that a replayed log gives the same numbers.

No clock is read here. A SYNC opens a window, readings fill it, and it closes

- at the next SYNC, or
- as soon as every PDO that was heard in one of the last three windows has come, none of them in doubt.

A PDO does not say which SYNC it answers, and a node that was held up answers an old one after the next has been sent.
So answers are counted: each SYNC is owed one by each PDO, and a PDO is of the newest SYNC only when with it nothing is
owed any more. Until then it is in doubt and not taken. An answer that really was lost is forgotten, and the doubt with
it, once `DOUBT_NS` has passed in which each window brought exactly one.

A reading is *late*, and not taken, when it is in doubt, when its window has been closed, or when it comes in the last
tenth of the SYNC period (CiA 301 calls the rest the synchronous window, 0x1007). It is a *duplicate* when nothing is
owed: the first is kept.

A snapshot's time is its SYNC's kernel time in whole microseconds. That is one bit on a 1 Mbit/s bus, and what a candump
log holds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.pipeline.snapshot import ROW, WHEELS, AcquisitionCounters, Array, Snapshot
from regolithd.drivers.devices.decoding.signals import Reading, Sync
from regolithd.drivers.devices.registry import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterable

    from regolithd.drivers.devices.node import NodeDescription

MEMORY = 3
"""Windows for which a PDO that stopped coming is still waited for."""

DOUBT_NS = 500_000_000
"""Longer than a node, or the computer that runs a virtual one, is held up; at least `MEMORY` windows."""

SYNCHRONOUS_WINDOW = 0.9
"""Share of the SYNC period in which an answer counts."""


@dataclass(slots=True)
class _Account:
    """What one PDO owes: answers to how many SYNCs, and for how many windows in a row it has sent exactly one."""

    owed: int = 0
    steady: int = 0
    came: int = 0

    def settle(self, doubtful_windows: int) -> None:
        """Close the books of a window, and owe the next answer."""
        self.steady = self.steady + 1 if self.owed and self.came == 1 else 0
        if self.steady >= doubtful_windows:
            self.owed = self.steady = 0  # what is still owed was lost
        self.owed += 1
        self.came = 0


class Acquisition:
    """Assembles snapshots. Feed it every decoded `Sync` and `Reading` in the order of the bus.

    Parameters
    ----------
    nodes
        Who is expected on the bus.
    pdos
        The identifiers of the PDOs that they are configured to send; what does not come counts as missing.
    period_ns
        The SYNC period.
    """

    def __init__(self, nodes: Iterable[NodeDescription], pdos: Iterable[int], period_ns: int) -> None:
        self._wheels = {node.node_id: node.wheel for node in nodes}
        self._pdos = frozenset(pdos)
        self._window_ns = int(period_ns * SYNCHRONOUS_WINDOW)
        self._doubtful_windows = max(MEMORY, -(-DOUBT_NS // period_ns))
        self._sequence = -1
        self._open: Array | None = None
        self._sync_ns = 0
        self._accounts: dict[int, _Account] = {}
        self._heard: list[set[int]] = []
        self._awaited: set[int] = set()
        self._taken: set[int] = set()
        self._snapshots = self._accepted = self._late = self._duplicate = self._unexpected = self._missing = 0

    @property
    def counters(self) -> AcquisitionCounters:
        """Return what became of everything so far."""
        return AcquisitionCounters(
            self._snapshots, self._accepted, self._late, self._duplicate, self._unexpected, self._missing
        )

    def accept(self, item: Sync | Reading) -> Snapshot | None:
        """Take the next thing that was on the bus; return the snapshot that it completes, if any."""
        if isinstance(item, Sync):
            closed = self._close() if self._open is not None else None
            self._begin(item.time_ns)
            return closed
        return self._read(item)

    def _begin(self, time_ns: int) -> None:
        if self._sequence >= 0:
            self._heard = [*self._heard[1 - MEMORY :], self._came]
            self._awaited = set().union(*self._heard)
        for account in self._accounts.values():
            account.settle(self._doubtful_windows)
        self._taken = set()
        self._sequence += 1
        self._sync_ns = time_ns
        self._open = np.full((len(QUANTITIES), WHEELS), np.nan)

    @property
    def _came(self) -> set[int]:
        """The PDOs that have come in this window."""
        return {cob_id for cob_id, account in self._accounts.items() if account.came}

    def _read(self, reading: Reading) -> Snapshot | None:
        if reading.node_id not in self._wheels:
            self._unexpected += 1
            return None
        if self._sequence < 0:
            self._late += 1
            return None
        account = self._accounts.setdefault(reading.cob_id, _Account(owed=1))  # the first one ever is of this SYNC
        account.came += 1
        if not account.owed:
            self._duplicate += 1
            return None
        account.owed -= 1
        in_window = reading.time_ns - self._sync_ns <= self._window_ns
        if account.owed or not in_window or self._open is None:
            self._late += 1
            return None
        self._accepted += 1
        self._taken.add(reading.cob_id)
        self._enter(self._open, reading)
        return self._close() if self._awaited and self._complete() else None

    def _complete(self) -> bool:
        accounts = [self._accounts[cob_id] for cob_id in self._awaited]
        return all(account.came and not account.owed for account in accounts)

    def _enter(self, values: Array, reading: Reading) -> None:
        wheel = self._wheels[reading.node_id]
        for quantity, value in reading.values:
            if wheel is None:
                values[ROW[quantity]] = value
            else:
                values[ROW[quantity], wheel] = value

    def _close(self) -> Snapshot:
        values = self._open
        assert values is not None  # noqa: S101  # only an open window is closed
        values.flags.writeable = False
        self._open = None
        self._snapshots += 1
        self._missing += len(self._pdos - self._taken)
        return Snapshot(self._sequence, self._sync_ns // 1000 * 1000, values)
