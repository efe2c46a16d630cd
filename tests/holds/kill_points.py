"""A process that stores and acknowledges is killed at random points; the next one must find all that waits."""

from __future__ import annotations

import mmap
import os
import random
import signal
import struct
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.daemon.publish.spool import Spool

if TYPE_CHECKING:
    from pathlib import Path

REPORT = struct.Struct("<QQQ")  # next index; first that waits; first that waits after an acknowledgement under way
LIMIT_BYTES, SEGMENT_BYTES = 1_000_000_000, 20_000
LONGEST_S = 0.04
MOST_WAITING = 400


@dataclass
class Kills:
    """Points, records that were stored in all, and records that were lost, altered or out of order."""

    points: int = 0
    stored: int = 0
    lost: int = 0
    altered: int = 0


def payload(index: int) -> bytes:
    """Return a payload that follows from the index, of 100 to 1000 bytes."""
    return b"%d " % index * (1 + index % 37) + b"x" * 90


def kill_points(folder: Path, points: int, seed: int) -> Kills:
    """Kill at `points` random moments, each time checking all that waits."""
    chance, found = random.Random(seed), Kills()
    report = mmap.mmap(-1, REPORT.size)  # shared with the child
    for _ in range(points):
        child = os.fork()
        if child == 0:
            work(folder, report, chance.randrange(1 << 30))
        time.sleep(chance.uniform(0.002, LONGEST_S))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        check(folder, report, found)
        found.points += 1
    return found


def work(folder: Path, report: mmap.mmap, seed: int) -> None:
    """Store and acknowledge for ever; report each step after it is done, and an acknowledgement before as well."""
    chance = random.Random(seed)
    spool = Spool(folder, LIMIT_BYTES, segment_bytes=SEGMENT_BYTES)
    while True:
        if spool.queued > MOST_WAITING or (spool.queued and chance.random() < 0.3):
            end = spool.first + min(spool.queued, chance.randint(1, 60))
            report[:] = REPORT.pack(spool.next, spool.first, end)
            spool.acknowledge(end, end - spool.first)
        else:
            spool.append("snapshot", payload(spool.next))
        if chance.random() < 0.01:
            spool.begin_sync()()
        report[:] = REPORT.pack(spool.next, spool.first, spool.first)


def check(folder: Path, report: mmap.mmap, found: Kills) -> None:
    """Compare the store with the last report of the process that was killed."""
    stored, first, under_way = REPORT.unpack(report[:])
    spool = Spool(folder, LIMIT_BYTES, segment_bytes=SEGMENT_BYTES)
    expected, position = spool.first, spool.first
    found.lost += not first <= spool.first <= max(first, under_way)
    while records := spool.read(position):
        for record in records:
            found.lost += record.index - expected
            found.altered += record.payload != payload(record.index)
            expected = record.index + 1
        position = expected
    found.lost += max(0, stored - expected)
    found.stored = expected
    spool.close()
