"""One number that decides: how it is declared, and as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

TRIALS = "development trials"
CHOICE = "choice"


def threshold(value: float, meaning: str, found: str) -> Any:  # noqa: ANN401  # a dataclass field of the value's type
    """Return a dataclass field with this default value, its meaning and how it was found."""
    return field(default=value, metadata={"meaning": meaning, "found": found})


@dataclass(frozen=True)
class Threshold:
    """One number that decides, as data.

    Attributes
    ----------
    name: the attribute of `Thresholds`
    value: in use
    meaning: what it decides, with its unit
    found: how the value was found: a standard result, a choice, or development trials
    """

    name: str
    value: float
    meaning: str
    found: str
