"""The room that recordings may take: `limit_MB`, or what the disk has where that is less. The oldest make room.

A recording goes as a whole, log and MCAP file together, so that each that stays can be replayed; the one being written
stays. NUMBER in the names says which are the oldest, as the wall clock may be set back.
"""

from __future__ import annotations

import re
import shutil
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

MEGABYTE = 1_000_000
RESERVE = 0.05
"""Share of the room that stays free on the disk."""
LARGEST_SHARE = 0.1
"""Share of the room that one recording may take before the next begins: so little goes at a time."""
_NUMBERED = re.compile(r"rover-\d{8}T\d{6}Z-(\d{6,})")


@dataclass(frozen=True, slots=True)
class Room:
    """The bytes that recordings may take, and whether some were deleted although all were within the limit."""

    size: float
    deleted_early: bool = False

    def is_short(self, folder: Path) -> bool:
        """Return whether the disk has less than its reserve."""
        return shutil.disk_usage(folder).free < RESERVE * self.size


def make_room(folder: Path, limit_MB: float, stays: Path | None = None) -> Room:
    """Delete the oldest recordings until all are within the limit and the disk has its reserve; `stays` is kept.

    `stays` is a path of the recording that is being written, with any suffix.
    """
    limit = limit_MB * MEGABYTE
    recordings: dict[Path, dict[Path, int]] = {}
    for path in oldest_first(folder):
        with suppress(FileNotFoundError):  # somebody else has deleted it
            recordings.setdefault(path.with_suffix(""), {})[path] = path.stat().st_size
    total = sum(sum(files.values()) for files in recordings.values())
    room = Room(min(limit, total + shutil.disk_usage(folder).free))
    early = False
    for stem, files in recordings.items():
        if stays is not None and stem == stays.with_suffix(""):
            continue
        if total <= limit and not room.is_short(folder):
            break
        early = early or total <= limit
        for path, size in files.items():
            path.unlink(missing_ok=True)
            total -= size
    return Room(room.size, early)


def oldest_first(folder: Path) -> list[Path]:
    """Return the files of all recordings by their numbers; first those of version 0.1, which have none, by name."""
    ours = [path for path in folder.glob("rover-*") if path.suffix in {".mcap", ".log"}]
    return sorted(ours, key=lambda path: (_number(path), path.name))


def next_stem(folder: Path, now_ns: int) -> Path:
    """Return the path, without a suffix, of the next recording."""
    number = 1 + max(map(_number, oldest_first(folder)), default=0)
    moment = datetime.fromtimestamp(now_ns // 1_000_000_000, UTC)
    return folder / f"rover-{moment:%Y%m%dT%H%M%SZ}-{number:06d}"


def _number(path: Path) -> int:
    match = _NUMBERED.fullmatch(path.stem)
    return int(match[1]) if match else 0
