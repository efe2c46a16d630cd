"""The first fields of every MQTT message, and the field types that several messages share.

A message is one JSON object; its first fields are those of `Header`. Names of numbers end in their unit; angles are in
radians. `null` means "not measured" or "no estimate": a value that did not arrive is never repeated and never invented.
A list of six belongs to wheels 1 to 6: odd left, even right; 1, 2 front, 3, 4 middle, 5, 6 rear.

For example, `regolith/kapvik/wheel/5`:

    {"schema_version": 2, "late": false, "session": "20130611T140312Z-5f1c", "sequence": 500,
     "time": "2013-06-11T14:07:22.018291000Z", "time_ms": 1370959642018, "wheel": 5,
     "measured": true, "valid": true, "motor_current_A": 0.08,
     "load_N": 31.6, "slip": 0.025, "slip_source": "configured", "cohesion_Pa": 3352.0, "friction_angle_rad": 0.499, …}
"""

from __future__ import annotations

from datetime import UTC, datetime
from functools import lru_cache
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

SCHEMA_VERSION = 2
"""Rises when a field or topic is removed or changes its meaning; new fields alone do not raise it."""

_PER_SECOND = 1_000_000_000
_PER_MILLISECOND = 1_000_000

Time = Annotated[
    str,
    Field(
        pattern=r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{9}Z$",
        description="UTC, ISO 8601, nanoseconds: text, because JSON numbers above 2^53 lose digits in many readers.",
        examples=["2013-06-11T14:07:22.018291000Z"],
    ),
]
WheelNumber = Annotated[int, Field(ge=1, le=6, description="Odd left, even right; 1, 2 front, 3, 4 middle, 5, 6 rear.")]
NodeNumber = Annotated[int, Field(ge=1, le=127, description="CANopen node-ID.")]


@lru_cache(maxsize=4)
def _second(seconds: int) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%S.")


def iso_time(time_ns: int) -> str:
    """Return a time [ns since 1970, CLOCK_REALTIME] as text, in the format of `Time`."""
    seconds, rest = divmod(time_ns, _PER_SECOND)
    return f"{_second(seconds)}{rest:09d}Z"


def time_fields(time_ns: int) -> dict[str, str | int]:
    """Return the fields `time` and `time_ms` of a message [ns since 1970]."""
    return {"time": iso_time(time_ns), "time_ms": time_ns // _PER_MILLISECOND}


class Header(BaseModel):
    """The fields that every message begins with."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_serialization_defaults_required=True, defer_build=True
    )

    schema_version: Literal[2] = 2
    """Rises when a field or topic is removed or changes its meaning."""
    late: bool = False
    """True: the message comes from the store, because the broker could not be reached when it was created. It may have
    been received before: compare `session` and `sequence`."""
    session: str
    """Identifies one run of the daemon; sorts by start time."""
    sequence: Annotated[int, Field(ge=0)]
    """Counts within a session and topic; on `snapshot` and `wheel` the number of the SYNC, on `state` that of the
    attempt to connect. Numbers are left out only where a channel is not stored while the broker cannot be reached."""
    time: Time
    time_ms: Annotated[int, Field(ge=0)]
    """The same time in milliseconds since 1970, for programs that read numbers only."""
