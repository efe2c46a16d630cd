"""A stored message, and what a file of the store was found to hold."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Record:
    """One stored message: its topic below `<prefix>/<rover>/`, and its payload.

    `stored_ns` is when it was stored (CLOCK_MONOTONIC), or None where it was read back from disk.
    """

    index: int
    topic: str
    payload: bytes
    stored_ns: int | None = None


@dataclass(frozen=True, slots=True)
class SegmentContents:
    """The valid records of a file; `end` is one past the index of the last record, `damaged` ones included.

    `torn`: it ends within a record, which begins at offset `size`, and whose index is free again.
    """

    records: list[Record]
    end: int
    damaged: int
    torn: bool
    size: int
