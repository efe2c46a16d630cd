"""Errors of the mismatch tool's input.

MismatchError
├── RecordingError          the recording cannot be read as one (also a ValueError)
│   └── MissingColumnError  a column that the simulation reads is not there (also a KeyError)
└── SimulationError         SIM.toml or the user's class is not a simulation (also a ValueError)

What the comparison can do without is no error but a note in the answer.
"""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

NEAR = 0.66
"""Share of the letters that a name has in common with the one that was perhaps meant (a choice: two of three; difflib's
ratio)."""
MOST_NAMES = 20
"""Names that a message lists at most."""


class MismatchError(Exception):
    """The comparison is impossible."""


class RecordingError(MismatchError, ValueError):
    """The recording lacks what the simulation predicts, or is no table of times and wheels."""


class MissingColumnError(RecordingError, KeyError):
    """A column that the simulation reads is neither recorded nor derived; `name` is the column."""

    def __init__(self, name: str, message: str) -> None:
        super().__init__(message)
        self.name = name

    __str__ = Exception.__str__  # KeyError would put the message in quotes


class SimulationError(MismatchError, ValueError):
    """The simulation's description is wrong: an unknown model, table or key, or a value out of range.

    `keys` is the place in SIM.toml, ("parameters", "mass_kg", "value"), where there is one; the reader of the file
    """

    def __init__(self, message: str, keys: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.keys = keys


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return "did you mean …?" where a known name is close to `name`, else "it has …", the known names."""
    names = [str(each) for each in known]
    near = get_close_matches(name.lower(), [each.lower() for each in names], 1, NEAR)
    if near:
        return f"did you mean {next(each for each in names if each.lower() == near[0])}?"
    return f"it has {listed(names)}"


def counted(number: int, noun: str) -> str:
    """Return '1 gap' or '2 gaps'."""
    return f"{number} {noun}" + ("" if number == 1 else "s")


def listed(names: Iterable[str]) -> str:
    """Return names separated by commas, at most twenty of them, each printable and short."""
    shown = [text if text.isprintable() and len(text) <= 60 else repr(text[:60]) for text in map(str, names)]
    more = f" and {len(shown) - MOST_NAMES} more" if len(shown) > MOST_NAMES else ""
    return (", ".join(shown[:MOST_NAMES]) or "nothing") + more
