"""Find the physics that a simulation leaves out of a recording: locate it, name it, fit it, and show the fit improve.

    from regolithd.calibration.mismatch import compare, load_simulation, read_recording

    answer = compare(read_recording(Path("drive.csv")), load_simulation(Path("SIM.toml"))).answer

The public names are below; each is imported when it is first used, so that reading a recording loads no solver.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Coefficient, Shape
    from regolithd.calibration.mismatch.candidates.library import library
    from regolithd.calibration.mismatch.data.recording import Recording, as_recording, from_columns, read_recording
    from regolithd.calibration.mismatch.errors import MismatchError, RecordingError, SimulationError
    from regolithd.calibration.mismatch.fleet.comparison import Member, compare
    from regolithd.calibration.mismatch.problem.covariates import direction_of
    from regolithd.calibration.mismatch.problem.prior import Prior, SensorError
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.simulation.load import load_simulation
    from regolithd.calibration.mismatch.simulation.simulation import Array, Simulation

__all__ = [
    "Array",
    "Candidate",
    "Coefficient",
    "Member",
    "MismatchError",
    "Prior",
    "Problem",
    "Recording",
    "RecordingError",
    "SensorError",
    "Shape",
    "Simulation",
    "SimulationError",
    "as_recording",
    "compare",
    "direction_of",
    "from_columns",
    "library",
    "load_simulation",
    "read_recording",
]

_HOME = {
    "candidates.candidate": ("Candidate", "Coefficient", "Shape"),
    "candidates.library": ("library",),
    "data.recording": ("Recording", "as_recording", "from_columns", "read_recording"),
    "errors": ("MismatchError", "RecordingError", "SimulationError"),
    "fleet.comparison": ("Member", "compare"),
    "problem.covariates": ("direction_of",),
    "problem.prior": ("Prior", "SensorError"),
    "problem.problem": ("Problem",),
    "simulation.load": ("load_simulation",),
    "simulation.simulation": ("Array", "Simulation"),
}
"""The module below this package that defines each public name."""


def __getattr__(name: str) -> object:
    for module, names in _HOME.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
