"""The store behaves as a list that survives its process, whatever happens to process, disk and files.

The model is a dictionary of all messages that wait. Rules store, read, acknowledge, sync, kill the process with half a
record behind, refuse writes, and flip bits in files; the store must always give back what the model holds, except one
record for each flipped bit, and must have counted it then.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from unittest.mock import patch

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from regolithd.daemon.publish.segment_format import pack
from regolithd.daemon.publish.spool import Spool

TOPICS = st.sampled_from(["snapshot", "event", "alarm/bus", "node/13"])
PAYLOADS = st.binary(max_size=80)
SEGMENT_BYTES = 600


class StoreModel(RuleBasedStateMachine):
    """The store beside its model."""

    @initialize()
    def open(self) -> None:
        """Begin with an empty folder."""
        self.folder = Path(tempfile.mkdtemp())
        self.waiting: dict[int, tuple[str, bytes]] = {}
        self.in_memory: set[int] = set()
        self.flipped = 0
        self.store = self._opened()

    def _opened(self) -> Spool:
        return Spool(self.folder, 10_000_000, segment_bytes=SEGMENT_BYTES)

    def _restart(self) -> None:
        """Open the store in a new process: what was in memory alone is lost."""
        self.store.close()
        for index in self.in_memory:
            self.waiting.pop(index, None)
        self.in_memory.clear()
        self.store = self._opened()

    def _append(self, topic: str, payload: bytes) -> int:
        index = self.store.append(topic, payload)
        assert index not in self.waiting
        self.waiting[index] = (topic, payload)
        return index

    @rule(topic=TOPICS, payload=PAYLOADS, times=st.integers(1, 25))
    def append(self, topic: str, payload: bytes, times: int) -> None:
        """Store messages."""
        for _ in range(times):
            self._append(topic, payload)

    @rule(topic=TOPICS, payload=PAYLOADS, taken=st.integers(-1, 30))
    def append_refused(self, topic: str, payload: bytes, taken: int) -> None:
        """Store a message that the disk refuses, or takes a part of."""
        write = os.write

        def refuse(file: int, data: bytes) -> int:
            if taken < 0:
                raise OSError(28, "No space left on device")
            return write(file, data[:taken])

        with patch("regolithd.daemon.publish.segment.os.write", refuse):
            self.in_memory.add(self._append(topic, payload))
        assert self.store.counters.unstored

    @precondition(lambda self: self.waiting)
    @rule(share=st.floats(0.0, 1.0))
    def acknowledge(self, share: float) -> None:
        """Acknowledge the first of the messages that can be read."""
        records = self.store.read(self.store.first)
        count = round(share * len(records))
        if count:
            end = records[count - 1].index + 1
            self.store.acknowledge(end, count)
            self.waiting = {index: each for index, each in self.waiting.items() if index >= end}
            self.in_memory = {index for index in self.in_memory if index >= end}

    @rule()
    def sync(self) -> None:
        """Sync to the disk."""
        self.store.begin_sync()()

    @rule(torn=st.integers(0, 25))
    def kill(self, torn: int) -> None:
        """Kill the process while it writes a record."""
        files = sorted(self.folder.glob("*.segment"))
        if files:
            with files[-1].open("ab") as file:
                file.write(pack(self.store.next, "event", b"half")[:torn])
        self._restart()

    @rule(which=st.integers(0, 100), place=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
    def flip(self, which: int, place: float, bit: int) -> None:
        """Flip a bit of a file while no process runs."""
        files = sorted(self.folder.glob("*.segment"))
        if files:
            path = files[which % len(files)]
            data = bytearray(path.read_bytes())
            data[int(place * len(data))] ^= 1 << bit
            path.write_bytes(data)
            self.flipped += 1
        self._restart()

    @rule(place=st.integers(0, 11), bit=st.integers(0, 7))
    def flip_cursor(self, place: int, bit: int) -> None:
        """Flip a bit of the file that says what is acknowledged: nothing waits longer, nothing is lost."""
        path = self.folder / "acknowledged"
        data = bytearray(path.read_bytes())
        if place < len(data):
            data[place] ^= 1 << bit
            path.write_bytes(data)
        self._restart()
        first = min(self.waiting, default=self.store.next)
        records = [record.index for record in self.store.read(self.store.first) if record.index < first]
        if self.store.first < first:  # sent again: the broker has them already
            self.store.acknowledge(first, len(records))

    @invariant()
    def all_that_waits_can_be_read(self) -> None:
        """Everything comes back in order as it was stored; what does not was counted as damaged."""
        if not hasattr(self, "store"):
            return
        found: list[int] = []
        position = self.store.first
        while records := self.store.read(position):
            for record in records:
                assert (record.topic, record.payload) == self.waiting[record.index]
            found += [record.index for record in records]
            position = found[-1] + 1
        assert found == sorted(set(found))
        missing = self.waiting.keys() - set(found)
        assert len(missing) <= self.flipped
        assert not missing or self.store.counters.damaged or self.store.counters.torn

    def teardown(self) -> None:
        """Remove the folder."""
        if hasattr(self, "store"):
            self.store.close()
            shutil.rmtree(self.folder)


TestStoreModel = StoreModel.TestCase
TestStoreModel.settings = settings(
    max_examples=int(os.environ.get("STORE_EXAMPLES", "60")), stateful_step_count=30, deadline=None
)
