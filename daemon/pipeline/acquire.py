"""Assembles snapshots from decoded frames: a pure function of the frame stream, so a replay gives the same numbers.

No clock is read here. A SYNC opens a window, and readings fill it. It closes

- at the next SYNC, or
- as soon as every PDO that came in one of the last three windows has come in this one, none of them ambiguous. A PDO
  that starts to come, since its node has booted, is not waited for yet: its first answer may be late.

A PDO does not say which SYNC it answers, and a node that was delayed may answer an old SYNC after the next has been
sent. So the answers of each PDO are counted: each SYNC makes one more outstanding, each answer one fewer.

| a reading comes, and | it is | what is done |
|---|---|---|
| nothing was outstanding | duplicate | dropped: the first is kept |
| more answers are outstanding after it | ambiguous: it may answer an old SYNC | dropped, counted as late |
| its window is closed, or 0.9 of the SYNC period has passed (0x1007, synchronous window) | late | dropped |
| otherwise | the answer to the newest SYNC | accepted |

An answer that was lost would keep its PDO ambiguous. It is forgotten once each window of the last `AMBIGUITY_NS`
brought exactly one answer. A node that paused, for however long, and then answers what it has missed is told apart all
the same: windows without an answer, or with several, do not count as such.

One case cannot be told apart by the frames: a node that answers each SYNC exactly once, but for `AMBIGUITY_NS`, or from
its first answer on, always by whole periods too late, is on the bus the same as one that answers in time after it has
lost as many answers. Its values are then taken for those of the newest SYNC. A TPDO waits in its node for a free bus
alone, so this needs a bus on which it always waits for longer than a period (`regolithd check` gives the bus load), or
an adapter that holds frames back. A node with a synchronous window (0x1007) discards what is late by itself.

Two cases in which nobody can say whose values these are, or of which instant, are noticed, and the values are dropped:

- Two nodes with one node-ID: a single node never answers more often than there were SYNCs, so a PDO that was a
  duplicate in `DUPLICATES` of the last `DOUBT_WINDOWS` windows has two senders (one duplicate alone may be a frame that
  the CAN controller received twice). The node's values are dropped until its PDOs come once again.
- A second SYNC producer: once our own SYNCs were seen, those of somebody else open no window, and for `DOUBT_WINDOWS`
  windows after one, all values are dropped: they may have been sampled at the other SYNC.

A snapshot's time is its SYNC's kernel time in whole microseconds. That is one bit on a 1 Mbit/s bus, and the resolution
of a candump log.
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

AWAITED_WINDOWS = 3
"""Number of windows for which a PDO that stopped coming is still waited for."""

AMBIGUITY_NS = 500_000_000
"""One answer in each window for so long: the outstanding ones were lost. At least `AWAITED_WINDOWS` windows."""

DOUBT_WINDOWS = 4
DUPLICATES = 2
"""Of `DOUBT_WINDOWS` windows: how many brought a PDO more often than a single node sends it."""

SYNCHRONOUS_WINDOW = 0.9
"""Share of the SYNC period in which an answer counts."""


@dataclass(slots=True)
class _PdoCount:
    """The answers of one PDO.

    Attributes
    ----------
    outstanding
        SYNCs that it has not answered yet.
    steady
        Windows in a row in which it came exactly once while an answer was outstanding.
    received
        How often it came in this window.
    duplicates
        The last `DOUBT_WINDOWS` windows as bits, the present one lowest: whether it was a duplicate.
    """

    outstanding: int = 0
    steady: int = 0
    received: int = 0
    duplicates: int = 0

    def begin_window(self, ambiguous_windows: int) -> None:
        """Count one more SYNC to be answered; forget lost answers after so many steady windows."""
        self.steady = self.steady + 1 if self.outstanding and self.received == 1 else 0
        if self.steady >= ambiguous_windows:
            self.outstanding = self.steady = 0  # the answers that are still outstanding were lost
        self.outstanding += 1
        self.received = 0
        self.duplicates = self.duplicates << 1 & (1 << DOUBT_WINDOWS) - 1

    @property
    def has_two_senders(self) -> bool:
        """Whether more answers came than one node sends."""
        return self.duplicates.bit_count() >= DUPLICATES


class Acquisition:
    """Assembles snapshots. Feed it every decoded `Sync` and `Reading` in the order of the bus.

    Parameters
    ----------
    nodes
        The configured nodes; readings of any other are counted as unexpected.
    pdos
        COB-IDs of the PDOs that they are configured to send; one that does not come counts as missing.
    period_ns
        The SYNC period.
    """

    def __init__(self, nodes: Iterable[NodeDescription], pdos: Iterable[int], period_ns: int) -> None:
        self._wheels = {node.node_id: node.wheel for node in nodes}
        self._shared: dict[int, set[int]] = {}  # node-ID → its PDOs that have two senders
        self._own_syncs = False
        self._foreign_sync_windows = 0  # that are still doubtful
        self._pdos = frozenset(pdos)
        self._window_ns = int(period_ns * SYNCHRONOUS_WINDOW)
        self._ambiguous_windows = max(AWAITED_WINDOWS, -(-AMBIGUITY_NS // period_ns))
        self._sequence = -1
        self._open: Array | None = None
        self._sync_ns = 0
        self._counts: dict[int, _PdoCount] = {}
        self._heard: list[set[int]] = []
        self._awaited: set[int] = set()
        self._due: set[int] = set()  # of those, PDOs whose answer to this SYNC has not come
        self._taken: set[int] = set()
        self._snapshots = self._accepted = self._late = self._duplicate = self._unexpected = self._missing = 0
        self._doubtful = 0

    @property
    def counters(self) -> AcquisitionCounters:
        """Return the counts of snapshots and readings so far."""
        return AcquisitionCounters(
            self._snapshots,
            self._accepted,
            self._late,
            self._duplicate,
            self._unexpected,
            self._missing,
            self._doubtful,
        )

    @property
    def shared_node_ids(self) -> tuple[int, ...]:
        """Node-IDs that two nodes have at present."""
        return tuple(sorted(self._shared))

    def accept(self, item: Sync | Reading) -> Snapshot | None:
        """Take the next SYNC or reading; return the snapshot that it completes, if any."""
        if isinstance(item, Sync):
            if self._own_syncs and not item.sent:
                self._foreign_sync_windows = DOUBT_WINDOWS
                return None
            self._own_syncs |= item.sent
            closed = self._close_window() if self._open is not None else None
            self._begin_window(item.time_ns)
            return closed
        return self._read(item)

    def _begin_window(self, time_ns: int) -> None:
        if self._sequence >= 0:
            self._heard = [*self._heard[1 - AWAITED_WINDOWS :], self._received_pdos]
            self._awaited = set().union(*self._heard)
            self._due = self._awaited.copy()
        for count in self._counts.values():
            count.begin_window(self._ambiguous_windows)
        if self._shared:
            self._shared = self._still_shared()
        self._foreign_sync_windows = max(self._foreign_sync_windows - 1, 0)
        self._taken = set()
        self._sequence += 1
        self._sync_ns = time_ns
        self._open = np.full((len(QUANTITIES), WHEELS), np.nan)

    def _still_shared(self) -> dict[int, set[int]]:
        """Return the PDOs that still have two senders, by node-ID."""
        shared = {
            node_id: {cob_id for cob_id in pdos if self._counts[cob_id].has_two_senders}
            for node_id, pdos in self._shared.items()
        }
        return {node_id: pdos for node_id, pdos in shared.items() if pdos}

    @property
    def _received_pdos(self) -> set[int]:
        """COB-IDs of the PDOs that came in this window."""
        return {cob_id for cob_id, count in self._counts.items() if count.received}

    def _read(self, reading: Reading) -> Snapshot | None:
        if reading.node_id not in self._wheels:
            self._unexpected += 1
            return None
        if self._sequence < 0:
            self._late += 1
            return None
        count = self._counts.setdefault(reading.cob_id, _PdoCount(outstanding=1))  # its first answers this SYNC
        count.received += 1
        if not count.outstanding:
            self._duplicate += 1
            self._note_duplicate(count, reading)
            return None
        count.outstanding -= 1
        if not count.outstanding:
            self._due.discard(reading.cob_id)
        in_window = reading.time_ns - self._sync_ns <= self._window_ns
        if count.outstanding or not in_window or self._open is None:
            self._late += 1
            return None
        if self._foreign_sync_windows or reading.node_id in self._shared:
            self._doubtful += 1
        else:
            self._accepted += 1
            self._taken.add(reading.cob_id)
            self._write(self._open, reading)
        return self._close_window() if self._awaited and not self._due else None

    def _note_duplicate(self, count: _PdoCount, reading: Reading) -> None:
        """Note that a PDO came more often than one node sends it; from the second window on, drop the node's values."""
        if self._foreign_sync_windows:
            return  # it answers the other SYNC
        count.duplicates |= 1
        if count.has_two_senders:
            self._shared.setdefault(reading.node_id, set()).add(reading.cob_id)
            wheel = self._wheels[reading.node_id]
            if self._open is not None:
                for quantity, _ in reading.values:
                    self._open[ROW[quantity], slice(None) if wheel is None else wheel] = np.nan

    def _write(self, values: Array, reading: Reading) -> None:
        wheel = self._wheels[reading.node_id]
        for quantity, value in reading.values:
            if wheel is None:
                values[ROW[quantity]] = value
            else:
                values[ROW[quantity], wheel] = value

    def _close_window(self) -> Snapshot:
        values = self._open
        assert values is not None  # noqa: S101  # only an open window is closed
        values.flags.writeable = False
        self._open = None
        self._snapshots += 1
        self._missing += len(self._pdos - self._taken)
        return Snapshot(self._sequence, self._sync_ns // 1000 * 1000, values)
