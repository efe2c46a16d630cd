"""What can be wrong with what the tool is given.

MismatchError
├── RecordingError      the recording cannot be read as one (also a ValueError)
└── SimulationError     SIM.toml or the user's class is not a simulation (also a ValueError)

Everything that can be worked around is not an error but a note in the answer.
"""


class MismatchError(Exception):
    """Whatever keeps the tool from comparing at all."""


class RecordingError(MismatchError, ValueError):
    """The recording lacks what the simulation predicts, or is no table of instants and wheels."""


class SimulationError(MismatchError, ValueError):
    """The simulation's description is wrong: an unknown model, table or key, or a value out of range."""
