"""The EDS files that a recording was made with, kept in its metadata: it replays where those files are not."""

from __future__ import annotations

import atexit
import hashlib
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.eds_text import decoded

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.daemon.config.configuration import Configuration

_KEY = "eds "
"""Begins the metadata's key of an EDS file; its path follows."""


def eds_metadata(configuration: Configuration) -> dict[str, str]:
    """Return the text of each EDS file that a configuration names, by its metadata key."""
    files = {table.eds for table in configuration.devices.values() if table.eds}
    return {f"{_KEY}{path}": decoded(path.read_bytes()) for path in sorted(files)}


def with_recorded_eds(configuration: Configuration, metadata: Mapping[str, str]) -> Configuration:
    """Return the configuration with each recorded EDS file as it was then, in a folder that lasts for this process."""
    recorded = {name.removeprefix(_KEY): text for name, text in metadata.items() if name.startswith(_KEY)}
    if not recorded:
        return configuration
    folder = Path(tempfile.mkdtemp(prefix="regolithd-eds-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    devices = {}
    for name, table in configuration.devices.items():
        text = recorded.get(str(table.eds))
        devices[name] = (
            table if text is None else table.model_copy(update={"eds": _written(folder, str(table.eds), text)})
        )
    return configuration.model_copy(update={"devices": devices})


def _written(folder: Path, name: str, text: str) -> Path:
    own = folder / hashlib.sha256(name.encode()).hexdigest()[:12]
    own.mkdir(exist_ok=True)
    path = own / Path(name).name
    path.write_text(text, encoding="utf-8")
    return path
