"""The JSON Schemas in an MCAP file: every field, in types that Foxglove's and Lichtblick's parsers take."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, get_args

import jsonschema
import pytest
from estimates import estimate
from mcap.reader import make_reader

from regolithd.calibration.posterior.change_detection import Alarm
from regolithd.calibration.posterior.estimator import FallProbability, Interval, Posterior
from regolithd.daemon.config.configuration import Recording
from regolithd.daemon.pipeline.snapshot import SoilChange
from regolithd.daemon.recording.recorder import Recorder
from regolithd.daemon.recording.schemas import SCHEMAS
from regolithd.daemon.service import event_json
from regolithd.drivers.canopen.emcy import Emergency
from regolithd.drivers.master.events import Identity, NetworkEvent

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from mcap.records import Schema

SCALARS = {"number", "integer", "string", "boolean"}


def refused(schema: dict[str, Any], place: str) -> Iterator[str]:
    """Yield each place that such a parser refuses."""
    kind = schema.get("type")
    if kind == "object":
        for name, field in schema["properties"].items():
            yield from refused(field, f"{place}.{name}")
    elif kind == "array":
        if schema["items"].get("type") not in SCALARS:
            yield f"{place}: an array of {schema['items']}"
    elif kind not in SCALARS:
        yield f"{place}: {schema}"


@pytest.mark.parametrize("topic", SCHEMAS)
def test_a_schema_has_plain_types_only(topic: str) -> None:
    """No choice of types, no reference, no null, no list of lists."""
    assert list(refused(SCHEMAS[topic], topic)) == []


def names(content: Any, place: str = "") -> set[str]:
    """Return the paths of all fields of a message or of a schema's properties."""
    if not isinstance(content, dict):
        return {place}
    inner = content.get("properties", content) if content.get("type") == "object" else content
    return {path for name, field in inner.items() for path in names(_plain(field), f"{place}/{name}")}


def _plain(field: Any) -> Any:
    return field if isinstance(field, dict) and field.get("type") in {None, "object"} else None


def test_the_schema_in_the_file_names_every_field_of_the_messages(tmp_path: Path) -> None:
    """What a recorder writes agrees with the schema that is in the same file, posterior and alarm included."""
    interval = Interval(1, 1, 1, 1, 1, 1)
    change = SoilChange(Alarm(2, 1, "fall", "front", 11.0, 10.8, 0.7), FallProbability(0.9, 0.5, 0.7))
    posterior = Posterior(interval, interval, interval, wheels=6, instants=20)
    recorder = Recorder(Recording(directory=tmp_path), "vcan0", {})
    recorder.estimate(replace(estimate(), posterior=posterior, soil_change=change))
    recorder.estimate(estimate(missing_wheel=2))
    recorder.close()
    (path,) = tmp_path.glob("*.mcap")
    with path.open("rb") as stream:
        found: dict[str, tuple[Schema, list[Any]]] = {}
        for schema, _, message in make_reader(stream).iter_messages():
            if schema is not None:
                found.setdefault(schema.name, (schema, []))[1].append(json.loads(message.data))
    for topic in ("snapshot", "estimate"):
        schema, messages = found[topic]
        told = names(json.loads(schema.data))
        for message in messages:
            assert names(message) <= told
            jsonschema.validate(message, json.loads(schema.data))
        assert "null" not in json.dumps(messages)
    assert {"/posterior/cohesion_Pa/median", "/soil_change/alarm/torque_ratio", "/outside_training_range_5"} <= told
    first, second = found["snapshot"][1]
    assert "load_N_3" in first
    assert "load_N_3" not in second


@pytest.mark.parametrize("event", get_args(NetworkEvent), ids=lambda event: event.__name__)
def test_the_schema_of_events_names_every_field_of_every_event(event: type) -> None:
    """An event may carry an object of its own, as the identity of a node that booted."""
    own = {"identity": Identity(1, 2, 3, 4, 5), "emergency": Emergency(1, 2, 3, 4, b"", "")}
    made = event(**{field.name: own.get(field.name, 0) for field in fields(event)})
    assert names(json.loads(event_json(made))) <= names(SCHEMAS["event"])
