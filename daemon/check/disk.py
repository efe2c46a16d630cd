"""Checks the folders of recordings and of stored messages: permissions, and free space on the disk."""

from __future__ import annotations

import os
import shutil
from typing import TYPE_CHECKING

from regolithd.daemon.check.finding import Finding, good, unknown, warning, wrong

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.daemon.config.configuration import Configuration


async def check_disks(configuration: Configuration) -> list[Finding]:
    """Check both folders."""
    recording, mqtt = configuration.recording, configuration.mqtt
    found = [check_folder("store", mqtt.spool_directory, mqtt.spool_limit_MB, "[mqtt] spool_directory")]
    if recording.enabled:
        folder = check_folder("recording", recording.directory, recording.limit_MB, "[recording] directory")
        return [folder, *found]
    return [unknown("recording", "switched off: [recording] enabled"), *found]


def check_folder(subject: str, folder: Path, limit_MB: float, key: str) -> Finding:
    """Return whether `folder` can be written, and the disk has space for its limit."""
    try:
        there = _existing(folder)
        if not there.is_dir():
            return wrong(subject, f"{there} is not a folder", f"Remove it, or choose another: {key}.")
        may_write = os.access(there, os.W_OK | os.X_OK)
        free = shutil.disk_usage(there).free / 1e6
        used = sum(file.stat().st_size for file in folder.glob("*") if file.is_file()) / 1e6
    except OSError as error:
        return unknown(subject, f"{folder}: {error.strerror}", "Check as the daemon's user: sudo -u regolithd …")
    if not may_write:
        remedy = f"Make the daemon's user its owner, or choose another: {key}. As that user: sudo -u regolithd …"
        return wrong(subject, f"{there} cannot be written by you ({_user()})", remedy)
    wanted = max(0.0, limit_MB - used)
    if free < wanted:
        text = f"{folder} may grow by {wanted:.0f} MB, but the disk has {free:.0f} MB"
        verdict = wrong if free < min(wanted, 100.0) else warning
        return verdict(subject, text, "Free space, or lower the limit beside " + key + ".")
    made = "" if there == folder else " (will be created)"
    return good(subject, f"{folder}{made}: {used:.0f} of {limit_MB:.0f} MB used, {free:.0f} MB free")


def _existing(folder: Path) -> Path:
    """Return the folder, or the nearest existing parent, in which it will be created."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder


def _user() -> str:
    return os.environ.get("USER") or f"user {os.getuid()}"
