"""Writes a file beside the one that it replaces, so that a failure leaves the earlier file as it was."""

from __future__ import annotations

import errno
import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

NO_ROW = "{}: 0 rows, so nothing is written. The recordings hold no snapshot that can be read."
_DISK_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


class ExportError(Exception):
    """The table cannot be written; the message says why and what to do."""


@contextmanager
def replacing(out: Path) -> Iterator[Path]:
    """Yield the path to write to. It takes the name `out` at the end, or is deleted where an error is raised.

    Raises
    ------
    ExportError
        Nothing can be written there.
    """
    target = out.resolve()  # where it is a link, the file that it leads to is replaced
    if not target.parent.is_dir():
        raise ExportError(f"{out}: there is no folder {target.parent}. Create it, or correct --to.")
    if target.is_dir():
        raise ExportError(f"{out}: this is a folder. Name a file in it with --to.")
    beside = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        yield beside
        beside.replace(target)
    except OSError as error:
        if error.errno in _DISK_FULL or error.filename == str(beside):
            remedy = "Free space, or name a file in another folder with --to"
            raise ExportError(f"{out}: it cannot be written: {os.strerror(error.errno or 0)}. {remedy}.") from error
        raise
    finally:
        beside.unlink(missing_ok=True)
