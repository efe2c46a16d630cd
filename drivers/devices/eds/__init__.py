"""The nodes' electronic data sheets (CiA 306): what the driver configures and what the virtual node is built from.

One file per `NodeKind`. Both sides read the same file, so an object that only one of them knows cannot exist.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regolithd.drivers.signals import NodeKind

_FOLDER = Path(__file__).parent


def eds_path(kind: NodeKind) -> Path:
    """Return the file that describes a node of this kind."""
    return _FOLDER / f"{kind.value}.eds"
