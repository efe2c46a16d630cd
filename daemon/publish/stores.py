"""The two stores of messages that the broker has not acknowledged: snapshots, and everything else.

Each has its own order, limit and unacknowledged messages. So a snapshot waits for snapshots alone: neither behind the
events of a node that babbles, nor does such a node fill the store of snapshots.

    stores = Stores.open(directory, limit_bytes=200_000_000)
    stores.snapshots, stores.others            # directory/, directory/others/

A store of version 0.1 or 0.2.0 held all messages in `directory`; they are delivered from there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.daemon.publish.spool import Spool

if TYPE_CHECKING:
    from pathlib import Path

OTHERS = "others"
SHARE_OF_OTHERS = 0.1
"""Share of the limit for everything but snapshots. At 10 Hz, snapshots are 90 % of what is stored, and more."""


@dataclass(frozen=True, slots=True)
class Stores:
    """The store of snapshots, and that of all other messages."""

    snapshots: Spool
    others: Spool

    @classmethod
    def open(cls, directory: Path, limit_bytes: int) -> Stores:
        """Open both below `directory`; `limit_bytes` is for all files together. Raises as `Spool` does."""
        snapshots = Spool(directory, int(limit_bytes * (1 - SHARE_OF_OTHERS)))
        try:
            return cls(snapshots, Spool(directory / OTHERS, int(limit_bytes * SHARE_OF_OTHERS)))
        except Exception:
            snapshots.close()
            raise

    @classmethod
    def memory_only(cls, directory: Path, problem: str) -> Stores:
        """Return stores that keep the newest messages in memory (`Spool.memory_only`)."""
        return cls(Spool.memory_only(directory, problem), Spool.memory_only(directory / OTHERS, problem))

    @property
    def both(self) -> tuple[Spool, Spool]:
        """Both stores, snapshots first."""
        return self.snapshots, self.others

    @property
    def problem(self) -> str:
        """Why messages are kept in memory only; empty while they are stored."""
        return self.snapshots.problem or self.others.problem

    @property
    def queued(self) -> int:
        """Number of messages that wait."""
        return self.snapshots.queued + self.others.queued

    def close(self) -> None:
        """Close both; waiting messages stay on the disk."""
        self.snapshots.close()
        self.others.close()
