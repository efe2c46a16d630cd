"""The documents in `docs/messages`, generated from the message models in `daemon/messages`.

`documents()` returns file name → text: a JSON Schema for each message, an AsyncAPI 3 document, and a table in Markdown.
`regolithd schema --write docs/messages` writes them; a test fails while they differ from the models.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from pydantic.json_schema import models_json_schema

from regolithd.daemon.messages.channels import CHANNELS, QoS
from regolithd.daemon.messages.examples import example
from regolithd.daemon.messages.field_docs import describe_fields
from regolithd.daemon.messages.header import SCHEMA_VERSION

if TYPE_CHECKING:
    from regolithd.daemon.messages.channels import Channel

WIDTH = 118
"""Of the examples' lines; a string that is longer stays whole."""

_PARAMETERS = {
    "wheel": {
        "description": "1 to 6: odd left, even right; 1, 2 front, 3, 4 middle, 5, 6 rear.",
        "enum": list("123456"),
    },
    "node_id": {"description": "The CANopen node-ID, 1 to 127."},
    "name": {"description": "Name of the alarm."},
    "rover": {"description": "[rover] name in rover.toml."},
}
_WHILE_AWAY = {"state": "sent at the next birth"}
_QOS_WORDS = {QoS.AT_MOST_ONCE: "0, at most once", QoS.AT_LEAST_ONCE: "1, acknowledged"}


def _title(channel: Channel) -> str:
    return channel.message.__name__


def _summary(channel: Channel) -> str:
    """Return the first paragraph of the message's docstring, as one line."""
    return " ".join((channel.message.__doc__ or "").strip().split("\n\n")[0].split())


def json_schemas() -> dict[str, dict[str, Any]]:
    """Return channel name → JSON Schema (2020-12) of its message."""
    schemas = {}
    for channel in CHANNELS:
        schema = channel.message.model_json_schema(mode="serialization")
        describe_fields(schema)
        schemas[channel.name] = {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
    return schemas


def asyncapi() -> dict[str, Any]:
    """Return the AsyncAPI 3.0 document: topics, qualities of service, messages."""
    _, definitions = models_json_schema(
        [(channel.message, "serialization") for channel in CHANNELS], ref_template="#/components/schemas/{model}"
    )
    describe_fields(definitions)
    return {
        "asyncapi": "3.0.0",
        "info": {
            "title": "regolithd",
            "version": f"{SCHEMA_VERSION}",
            "description": "What the daemon publishes. It subscribes to no topic and cannot be commanded over MQTT.",
        },
        "defaultContentType": "application/json",
        "servers": {
            "broker": {
                "host": "localhost:1883",
                "protocol": "mqtt",
                "protocolVersion": "5.0",
                "description": "[mqtt] host and port in rover.toml.",
                "bindings": {"mqtt": _server_binding()},
            }
        },
        "channels": {channel.name: _channel(channel) for channel in CHANNELS},
        "operations": {f"publish-{channel.name}": _operation(channel) for channel in CHANNELS},
        "components": {
            "messages": {_title(channel): _message(channel) for channel in CHANNELS},
            "schemas": definitions["$defs"],
        },
    }


def _server_binding() -> dict[str, Any]:
    will = {"topic": "regolith/{rover}/state", "qos": 1, "retain": True, "message": "offline, connection-lost"}
    return {"clientId": "regolithd-regolith-{rover}", "cleanSession": True, "keepAlive": 10, "lastWill": will}


def _channel(channel: Channel) -> dict[str, Any]:
    names = ["rover", *re.findall(r"\{(\w+)\}", channel.address)]
    return {
        "address": f"regolith/{{rover}}/{channel.address}",
        "description": f"{_summary(channel)} Published {channel.when}.",
        "parameters": {name: _PARAMETERS[name] for name in names},
        "messages": {_title(channel): {"$ref": f"#/components/messages/{_title(channel)}"}},
    }


def _operation(channel: Channel) -> dict[str, Any]:
    return {
        "action": "send",
        "channel": {"$ref": f"#/channels/{channel.name}"},
        "summary": _summary(channel),
        "messages": [{"$ref": f"#/channels/{channel.name}/messages/{_title(channel)}"}],
        "bindings": {"mqtt": {"qos": int(channel.qos), "retain": channel.retain}},
    }


def _message(channel: Channel) -> dict[str, Any]:
    return {
        "name": channel.name,
        "title": _title(channel),
        "summary": _summary(channel),
        "payload": {"$ref": f"#/components/schemas/{_title(channel)}"},
        "examples": [{"payload": example(channel)}],
    }


def table() -> str:
    """Return the message table in Markdown."""
    rows = [
        "| topic `regolith/<rover>/…` | content | published | QoS | retained | while disconnected |",
        "|---|---|---|---|---|---|",
    ]
    for channel in CHANNELS:
        away = "stored, sent late" if channel.stored else _WHILE_AWAY.get(channel.name, "not sent")
        rows.append(
            f"| [`{channel.address.replace('{', '<').replace('}', '>')}`]({channel.name}.schema.json) "
            f"| {_summary(channel)} | {channel.when} | {_QOS_WORDS[channel.qos]} "
            f"| {'yes' if channel.retain else 'no'} | {away} |"
        )
    return "\n".join(rows)


def _readme() -> str:
    return f"""\
# Messages

Generated from the models in `daemon/messages/` by `regolithd schema --write docs/messages`; do not edit. The same as an
AsyncAPI 3 document: [asyncapi.json](asyncapi.json).

{table()}

Every message is one JSON object and begins with `schema_version`, `late`, `session`, `sequence`, `time` and
`time_ms`. Names of numbers end in their unit; `null` means not measured, or no estimate. Lists of six belong to
wheels 1 to 6.

- `session` identifies one run of the daemon; `(session, sequence)` is unique on a topic. A message with `late: true`
  comes from the store, because the broker could not be reached when it was created. It may repeat one that was
  received before: compare `session` and `sequence`.
- `state` is `online` from birth to death. An `offline` ends the `online` of the same `session` and `sequence`, and no
  other. While `state` is `offline`, retained messages may be out of date. While it is `online`, a retained
  `node/…` or `alarm/…` of an earlier `session` is of a node that is in the configuration no longer: leave it out. (The
  broker keeps it until somebody publishes an empty retained message there: `mosquitto_pub -r -n -t TOPIC`.)
- `sequence` has gaps on `state`, where it counts attempts to connect, and on `wheel/…` and `health`, which are not
  stored while the broker cannot be reached. On the other topics a gap is a loss.
- `snapshot` is complete and in order. `wheel/…` carries the newest values without waiting for older ones, and is not
  stored while the broker cannot be reached.

## Examples

{_example_lines()}
"""


def _example_lines() -> str:
    """Return an example of each message, in the order of the table."""
    parts = []
    for channel in CHANNELS:
        text = json.dumps(example(channel), ensure_ascii=False)
        parts.append(f"### {channel.name}\n\n```json\n{_wrapped(text)}\n```")
    return "\n\n".join(parts)


def _wrapped(text: str) -> str:
    """Return JSON text in lines of at most `WIDTH` characters, broken after commas outside of strings."""
    lines = [""]
    for part in re.findall(r'(?:"(?:[^"\\]|\\.)*"|[^",])+,?', text):
        if lines[-1] and len(lines[-1]) + len(part) > WIDTH:
            lines.append("")
        lines[-1] += part if lines[-1] else part.lstrip()
    return "\n".join(lines)


def documents() -> dict[str, str]:
    """Return file name → text of everything in docs/messages."""
    files = {f"{name}.schema.json": _json(schema) for name, schema in json_schemas().items()}
    return files | {"asyncapi.json": _json(asyncapi()), "README.md": _readme()}


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"
