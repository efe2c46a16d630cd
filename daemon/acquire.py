"""From decoded frames to snapshots: a pure function of the frame stream, so that a replayed log gives the same numbers.

No clock is read here. A SYNC opens a window, readings fill it, and it closes

- at the next SYNC, or
- as soon as every PDO that was heard in one of the last three windows has come – unless one of them was missing in the
  window before: then the first that comes may be that window's, late, and only the next SYNC tells.

A reading is *late*, and not taken, when its window has been closed, when it comes in the last tenth of the SYNC period
(CiA 301 calls the rest the synchronous window, 0x1007), or when a second one of the same PDO follows in a window after
one that lacked it. Any other second reading is a *duplicate*; the first is kept.

A snapshot's time is its SYNC's kernel time in whole microseconds. That is one bit on a 1 Mbit/s bus, and what a candump
log holds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from daemon.snapshot import QUANTITIES, ROW, WHEELS, AcquisitionCounters, Array, Snapshot
from drivers.signals import Reading, Sync

if TYPE_CHECKING:
    from collections.abc import Iterable

    from drivers.signals import NodeDescription

MEMORY = 3
"""Windows for which a PDO that stopped coming is still waited for."""

SYNCHRONOUS_WINDOW = 0.9
"""Share of the SYNC period in which an answer counts."""


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
        self._sequence = -1
        self._open: Array | None = None
        self._sync_ns = 0
        self._came: dict[int, Reading] = {}
        self._heard: list[set[int]] = []
        self._awaited: set[int] = set()
        self._doubtful: set[int] = set()
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
            self._remember()
        self._sequence += 1
        self._sync_ns = time_ns
        self._open = np.full((len(QUANTITIES), WHEELS), np.nan)
        self._came = {}

    def _remember(self) -> None:
        """Learn from the window that ends whom to wait for in the next."""
        came = set(self._came)
        self._heard = [*self._heard[1 - MEMORY :], came]
        self._awaited = set().union(*self._heard)
        self._doubtful = self._awaited - came

    def _read(self, reading: Reading) -> Snapshot | None:
        cob_id = reading.cob_id
        if reading.node_id not in self._wheels:
            self._unexpected += 1
            return None
        if self._sequence < 0 or reading.time_ns - self._sync_ns > self._window_ns:
            self._late += 1
            return None
        if cob_id in self._came:
            self._read_again(reading)
            return None
        self._came[cob_id] = reading
        if self._open is None:
            self._late += 1
            return None
        self._accepted += 1
        self._enter(self._open, reading)
        complete = not self._doubtful and self._awaited and self._awaited <= self._came.keys()
        return self._close() if complete else None

    def _read_again(self, reading: Reading) -> None:
        if reading.cob_id in self._doubtful and self._open is not None:
            self._doubtful.discard(reading.cob_id)
            self._late += 1
            self._came[reading.cob_id] = reading
            self._enter(self._open, reading)
        else:
            self._duplicate += 1

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
        self._missing += len(self._pdos - self._came.keys())
        return Snapshot(self._sequence, self._sync_ns // 1000 * 1000, values)
