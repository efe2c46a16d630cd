"""Annotated files to start from: `regolithd mismatch --init KIND FOLDER` copies them."""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.errors import SimulationError

if TYPE_CHECKING:
    from pathlib import Path

FILES = {
    "rover-wheel": {"SIM.toml": "rover_wheel.toml"},
    "class": {"SIM.toml": "user_class.toml", "my_simulation.py": "user_simulation.py"},
    "fmu": {"SIM.toml": "fmu.toml"},
}
"""For each kind: the file to write, and the template that it is copied from."""


def write_templates(kind: str, folder: Path) -> tuple[Path, ...]:
    """Write the files of a kind of simulation and return their paths; nothing that exists is overwritten.

    Raises
    ------
    SimulationError
        For an unknown kind, or where a file is there already.
    """
    if kind not in FILES:
        raise SimulationError(f"--init takes {', '.join(FILES)}, not {kind}")
    paths = {folder / name: template for name, template in FILES[kind].items()}
    if taken := [path for path in paths if path.exists()]:
        raise SimulationError(f"{taken[0]} exists already; it is left as it is. Choose another folder.")
    folder.mkdir(parents=True, exist_ok=True)
    for path, template in paths.items():
        path.write_text(resources.files(__package__).joinpath(template).read_text("utf-8"), encoding="utf-8")
    return tuple(paths)
