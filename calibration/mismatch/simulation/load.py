"""SIM.toml names its simulation: `model = "rover-wheel"`, or a class of the user's own."""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.simulation.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


def load_simulation(tables: Mapping[str, Any], *, beside: Path | None = None) -> Simulation:
    """Return the simulation that SIM.toml's tables name.

    A user's module is looked for beside the TOML file too.

    Raises
    ------
    SimulationError
        When the model is unknown, or its tables are wrong.
    """
    model = tables.get("simulation", {}).get("model")
    if model == "rover-wheel":
        from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel  # noqa: PLC0415  # a user's own needs none of it

        return RoverWheel.from_tables(tables)
    if not isinstance(model, str) or ":" not in model:
        raise SimulationError(f'[simulation] model must be "rover-wheel" or "package.module:ClassName", not {model!r}')
    module_name, class_name = model.split(":", 1)
    if beside is not None and str(beside) not in sys.path:
        sys.path.insert(0, str(beside))
    try:
        found = getattr(importlib.import_module(module_name), class_name)
    except (ImportError, AttributeError) as error:
        raise SimulationError(f"the simulation {model} cannot be imported: {error}") from error
    if not (isinstance(found, type) and issubclass(found, Simulation)):
        raise SimulationError(f"{model} is not a subclass of regolithd.calibration.mismatch.Simulation")
    return found.from_tables(tables)
