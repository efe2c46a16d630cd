"""JSON Schemas of the messages in an MCAP file: plain types only, so that Foxglove and Lichtblick list every field.

Their parsers take objects, arrays of one type, and scalars; they refuse `anyOf`, `$ref`, lists of lists and null. In a
message a value that was not measured is null all the same.
"""

from __future__ import annotations

import json
from typing import Any

from regolithd.daemon.recording.content import ESTIMATE, EVENT, SNAPSHOT
from regolithd.daemon.recording.results import ESTIMATED, LEVELS, POSTERIOR
from regolithd.drivers.devices.registry import QUANTITIES

_NUMBER, _INTEGER, _TEXT = {"type": "number"}, {"type": "integer"}, {"type": "string"}


def _object(**properties: Any) -> dict[str, Any]:  # noqa: ANN401  # JSON Schemas
    return {"type": "object", "properties": properties}


def _six(kind: str) -> dict[str, Any]:
    return {"type": "array", "items": {"type": kind}}


_HEADER = {"sequence": _INTEGER, "time_ns": _INTEGER}
_INTERVAL = _object(**dict.fromkeys(LEVELS, _NUMBER))
_ALARM = _object(
    time_ns=_INTEGER,
    onset_ns=_INTEGER,
    direction=_TEXT,
    group=_TEXT,
    statistic=_NUMBER,
    threshold=_NUMBER,
    torque_ratio=_NUMBER,
)
_FALL = _object(cohesion=_NUMBER, friction_angle=_NUMBER, drawbar_margin=_NUMBER)

SCHEMAS = {
    SNAPSHOT: _object(**_HEADER, **{quantity.name: _six("number") for quantity in QUANTITIES}),
    ESTIMATE: _object(
        **_HEADER,
        **{name: _six("number") for name in ESTIMATED},
        slip_source=_six("string"),
        valid=_six("boolean"),
        model_version=_TEXT,
        posterior=_object(**dict.fromkeys(POSTERIOR, _INTERVAL), wheels=_INTEGER, instants=_INTEGER),
        soil_change=_object(alarm=_ALARM, fall=_FALL),
    ),
    EVENT: _object(event=_TEXT, time_ns=_INTEGER, node_id=_INTEGER, text=_TEXT, suppressed=_INTEGER),
}
"""Topic → schema. `outside`, a list of lists, is in the messages and not in the schema."""


def schema(topic: str) -> bytes:
    """Return the schema of a topic as JSON; of an unknown one, any object."""
    return json.dumps(SCHEMAS.get(topic, {"type": "object"})).encode()
