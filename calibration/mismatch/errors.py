"""Errors of the mismatch tool's input.

MismatchError
├── RecordingError      the recording cannot be read as one (also a ValueError)
└── SimulationError     SIM.toml or the user's class is not a simulation (also a ValueError)

What the comparison can do without is no error but a note in the answer.
"""


class MismatchError(Exception):
    """The comparison is impossible."""


class RecordingError(MismatchError, ValueError):
    """The recording lacks what the simulation predicts, or is no table of times and wheels."""


class SimulationError(MismatchError, ValueError):
    """The simulation's description is wrong: an unknown model, table or key, or a value out of range."""
