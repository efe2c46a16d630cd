"""SIM.toml names its simulation: `rover-wheel`, a class of the user's own, or an FMU."""

from __future__ import annotations

import importlib
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.simulation.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping

MODELS = 'model must be "rover-wheel", "package.module:ClassName" or "machine.fmu"'


def load_simulation(tables: Mapping[str, Any], *, beside: Path | None = None) -> Simulation:
    """Return the simulation that SIM.toml's tables name.

    A module or an FMU is looked for beside SIM.toml, or in `[simulation] path`, which is relative to SIM.toml.

    Raises
    ------
    SimulationError
        When the model is unknown, cannot be loaded, or its tables are wrong.
    """
    table = tables.get("simulation", {})
    model = table.get("model") if isinstance(table, dict) else None
    if not isinstance(model, str):
        raise SimulationError(f"[simulation] {MODELS}, not {model!r}")
    folder = (beside or Path.cwd()) / str(table.get("path", "."))
    if model == "rover-wheel":
        from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel  # noqa: PLC0415  # soil physics

        return RoverWheel.from_tables(tables)
    if model.endswith(".fmu"):
        from regolithd.calibration.mismatch.simulation.fmu import FmuSimulation  # noqa: PLC0415  # needs FMPy

        return FmuSimulation.from_file(folder / model, tables)
    if ":" not in model:
        raise SimulationError(f"[simulation] {MODELS}, not {model!r}")
    return _imported(model, folder).from_tables(tables)


def _imported(model: str, folder: Path) -> type[Simulation]:
    """Import a user's class; what its module raises is told with file and line."""
    module_name, class_name = model.split(":", 1)
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    try:
        found = getattr(importlib.import_module(module_name), class_name)
    except ModuleNotFoundError as error:
        raise SimulationError(
            f"the simulation {model} cannot be imported: {error}. It is looked for in {folder}; say where it is with "
            "[simulation] path"
        ) from error
    except Exception as error:  # a user's module may raise anything
        raise SimulationError(f"the simulation {model} cannot be imported: {where_raised(error)}") from error
    if not (isinstance(found, type) and issubclass(found, Simulation)):
        raise SimulationError(f"{model} is not a subclass of regolithd.calibration.mismatch.Simulation")
    return found


def where_raised(error: Exception) -> str:
    """Return what an exception says, with the file and line of the user's code that raised it."""
    if isinstance(error, SyntaxError):
        return f"{error.filename}, line {error.lineno}: {error.msg}"
    frames = traceback.extract_tb(error.__traceback__)
    place = f"{frames[-1].filename}, line {frames[-1].lineno}: " if frames else ""
    return f"{place}{type(error).__name__}: {error}"
