"""The answer of a fleet: the contract's, with rovers, recordings and dates."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from regolithd.calibration.mismatch.answer import Answer, CalibratedParameter, Effect, Unexplained, answer_schema
from regolithd.calibration.mismatch.fleet.member import ONLY_ROVER
from regolithd.calibration.mismatch.inference.statements import listed

FEW = 3
"""Recordings that are told by their names, at most (a choice: a line)."""


def to_the_minute(date: str) -> str:
    """Return a date and time of the answer (ISO 8601) as a sentence has it: 2026-05-10 00:00."""
    return date[:16].replace("T", " ")


@dataclass(frozen=True)
class FleetEffect(Effect):
    """An effect that the simulation leaves out, on some rovers and from some date on.

    Attributes
    ----------
    rovers: that have it
    recordings: in which it acts
    since, since_low, since_high: when it begins (ISO 8601), with a 90 % interval: the beginning of the first recording
        that has it; None where it was there from the first recording on, or the dates are not known
    until: the beginning of the first recording without it; None where it stays
    """

    rovers: tuple[str, ...] = ()
    recordings: tuple[str, ...] = ()
    since: str | None = None
    since_low: str | None = None
    since_high: str | None = None
    until: str | None = None


@dataclass(frozen=True)
class FleetUnexplained(Unexplained):
    """A structure that one recording shows, or that several have in common.

    Attributes
    ----------
    rovers, recordings, since, until: as of an effect
    """

    rovers: tuple[str, ...] = ()
    recordings: tuple[str, ...] = ()
    since: str | None = None
    until: str | None = None

    @property
    def told_where(self) -> str:
        """The recordings, or how many there are, and since when; and the rovers where these have names."""
        of = f" of {listed(self.rovers)}" if self.rovers != (ONLY_ROVER,) else ""
        if len(self.recordings) == 1:
            return f"{self.recordings[0]}{of}"
        when = "".join(
            f" {word} {to_the_minute(date)}" for word, date in (("since", self.since), ("until", self.until)) if date
        )
        few = len(self.recordings) <= FEW
        return f"{listed(self.recordings) if few else f'{len(self.recordings)} recordings'}{of}{when}"


@dataclass(frozen=True)
class FleetParameter(CalibratedParameter):
    """A parameter of the simulation, of one rover, or of all where `rovers` are several."""

    rovers: tuple[str, ...] = ()

    @property
    def told_name(self) -> str:
        """With the rover, where it is of one that has a name."""
        of_one = len(self.rovers) == 1 and self.rovers[0] != ONLY_ROVER
        return f"{self.name} of {self.rovers[0]}" if of_one else self.name


@dataclass(frozen=True)
class RoverOfFleet:
    """A rover's recordings: names in the order of time, and when the first and the last began."""

    name: str
    recordings: tuple[str, ...]
    first: str | None
    last: str | None


@dataclass(frozen=True)
class FleetAnswer(Answer):
    """The result of comparing many recordings together."""

    effects: tuple[FleetEffect, ...]
    unexplained: tuple[FleetUnexplained, ...]
    parameters: tuple[FleetParameter, ...]
    rovers: tuple[RoverOfFleet, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the JSON object: the contract's, with `rovers`."""
        return {
            **super().to_json(),
            "rovers": [vars(rover) | {"recordings": list(rover.recordings)} for rover in self.rovers],
        }


_NAMES = {"type": "array", "items": {"type": "string"}, "minItems": 1}
_DATE = {"type": ["string", "null"]}
_ADDED: dict[str, dict[str, dict[str, Any]]] = {
    "effect": {
        "rovers": _NAMES | {"description": "The rovers that have it."},
        "recordings": _NAMES | {"description": "The recordings in which it acts."},
        "since": _DATE
        | {
            "description": "When the first recording that has it began (ISO 8601); null: it was there from the first "
            "recording on, or the dates are not known."
        },
        "since_low": _DATE | {"description": "Lower end of the 90 % interval of `since`."},
        "since_high": _DATE | {"description": "Upper end."},
        "until": _DATE | {"description": "When the first recording without it began; null: it stays."},
    },
    "unexplained": {
        "rovers": _NAMES | {"description": "The rovers that show it."},
        "recordings": _NAMES | {"description": "The recording that shows it, or those that have it in common."},
        "since": _DATE | {"description": "As of an effect."},
        "until": _DATE | {"description": "As of an effect."},
    },
    "calibrated_parameter": {"rovers": _NAMES | {"description": "The rovers that share it."}},
}
"""Keys of a fleet's answer beyond those of one recording's."""
_ROVER = {
    "type": "object",
    "description": "A rover of the fleet.",
    "properties": {
        "name": {"type": "string", "description": "As the recordings, their folders or the command line name it."},
        "recordings": _NAMES | {"description": "Names of its recordings, in the order of time."},
        "first": _DATE | {"description": "When the first began; null: not known."},
        "last": _DATE | {"description": "When the last began."},
    },
    "required": ["name", "recordings", "first", "last"],
    "additionalProperties": False,
}


def fleet_answer_schema() -> dict[str, Any]:
    """Return the JSON Schema of a fleet's answer: that of one recording's, and the keys beyond it."""
    schema = deepcopy(answer_schema())
    schema["title"] = "Answer of regolithd mismatch for a fleet, version 2"
    schema["$id"] = schema["$id"].replace("mismatch-answer", "mismatch-fleet-answer")
    for part, properties in _ADDED.items():
        schema["$defs"][part]["properties"] |= properties
        schema["$defs"][part]["required"] += list(properties)
    schema["$defs"]["rover"] = _ROVER
    schema["properties"]["rovers"] = {
        "type": "array",
        "description": "The rovers and their recordings.",
        "items": {"$ref": "#/$defs/rover"},
        "minItems": 1,
    }
    schema["required"] += ["rovers"]
    return schema
