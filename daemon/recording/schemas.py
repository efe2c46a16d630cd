"""JSON Schemas of the messages in an MCAP file: flat, so that Foxglove and Lichtblick list every field.

Their parsers take objects, arrays of one type, and scalars; they refuse `anyOf`, `$ref`, lists of lists and null. The
messages agree: a value that was not measured is left out.
"""

from __future__ import annotations

import json
from typing import Any

from regolithd.daemon.recording.content import ESTIMATE, ESTIMATED, EVENT, SNAPSHOT, six
from regolithd.daemon.recording.results import LEVELS, OUTSIDE, POSTERIOR
from regolithd.drivers.devices.registry import QUANTITIES

_NUMBER, _INTEGER, _TEXT = {"type": "number"}, {"type": "integer"}, {"type": "string"}


def _object(**properties: Any) -> dict[str, Any]:  # noqa: ANN401  # JSON Schemas
    return {"type": "object", "properties": properties}


def _six(kind: dict[str, str], *names: str) -> dict[str, dict[str, str]]:
    """Return the schema of each value of wheels 1 to 6."""
    return {each: kind for name in names for each in six(name)}


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

_BODY = [quantity.name for quantity in QUANTITIES if not quantity.per_wheel]
_WHEEL = [quantity.name for quantity in QUANTITIES if quantity.per_wheel]

SCHEMAS = {
    SNAPSHOT: _object(**_HEADER, **_six(_NUMBER, *_WHEEL), **dict.fromkeys(_BODY, _NUMBER)),
    ESTIMATE: _object(
        **_HEADER,
        **_six(_NUMBER, *ESTIMATED),
        **_six(_TEXT, "slip_source", OUTSIDE),
        **_six({"type": "boolean"}, "valid"),
        model_version=_TEXT,
        posterior=_object(**dict.fromkeys(POSTERIOR, _INTERVAL), wheels=_INTEGER, instants=_INTEGER),
        soil_change=_object(alarm=_ALARM, fall=_FALL),
    ),
    EVENT: _object(
        event=_TEXT,
        time_ns=_INTEGER,
        node_id=_INTEGER,
        text=_TEXT,
        reason=_TEXT,
        remedy=_TEXT,
        state=_TEXT,
        suppressed=_INTEGER,
        identity=_object(**dict.fromkeys(("device_type", "vendor", "product", "revision", "serial"), _INTEGER)),
        emergency=_object(
            **dict.fromkeys(("time_ns", "node_id", "code", "register"), _INTEGER), vendor=_TEXT, text=_TEXT
        ),
    ),
}
"""Topic → schema."""


def schema(topic: str) -> bytes:
    """Return the schema of a topic as JSON; of an unknown one, any object."""
    return json.dumps(SCHEMAS.get(topic, {"type": "object"})).encode()
