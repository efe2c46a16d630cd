"""What is published agrees with the message models and the generated documents."""

import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from estimates import estimate
from pydantic import ValidationError

from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.documents import documents
from regolithd.daemon.messages.examples import example
from regolithd.daemon.messages.header import iso_time, time_fields
from regolithd.daemon.messages.measurements import SnapshotMessage, WheelMessage
from regolithd.daemon.messages.state import StateMessage
from regolithd.daemon.publish.encode import as_late, encode, write

DOCS = Path(__file__).resolve().parents[3] / "docs" / "messages"
SESSION = "20130611T140312Z-5f1c"


@pytest.mark.parametrize("missing_wheel", [None, 0, 3])
def test_what_is_written_is_what_the_models_would_write(missing_wheel: int | None) -> None:
    """The encoder's JSON equals that of the models, byte by byte."""
    snapshot, wheels = encode(estimate(missing_wheel=missing_wheel), SESSION)
    assert SnapshotMessage.model_validate_json(snapshot).model_dump_json().encode() == snapshot
    for wheel in wheels:
        assert WheelMessage.model_validate_json(wheel).model_dump_json().encode() == wheel


def test_numbers_arrive_to_the_last_bit() -> None:
    """A number that a subscriber parses equals the one that was sent."""
    sent = estimate()
    snapshot, wheels = encode(sent, SESSION)
    received = SnapshotMessage.model_validate_json(snapshot)
    np.testing.assert_array_equal(np.array(received.motor_current_A), sent.snapshot.motor_current_A)
    np.testing.assert_array_equal(np.array(received.cohesion_Pa), sent.cohesion_Pa)
    for k, payload in enumerate(wheels):
        wheel = WheelMessage.model_validate_json(payload)
        assert (wheel.wheel, wheel.friction_angle_rad) == (k + 1, sent.friction_angle_rad[k])


def test_what_was_not_measured_is_null_and_not_valid() -> None:
    """A missing value is null, neither NaN nor the previous value, and its wheel is not valid."""
    snapshot, wheels = encode(estimate(missing_wheel=3), SESSION)
    received = json.loads(snapshot)
    assert received["load_N"][3] is None
    assert received["statusword"] == [0x1237, 0x1237, 0x1237, None, 0x1237, 0x1237]
    assert received["measured"] == received["valid"] == [True, True, True, False, True, True]
    assert json.loads(wheels[3])["cohesion_Pa"] is None


def test_an_input_outside_the_training_range_is_marked_by_name() -> None:
    """The input is named for the wheel concerned."""
    snapshot, wheels = encode(estimate(), SESSION)
    assert json.loads(snapshot)["outside_training_range"] == [[], [], [], [], ["slip"], []]
    assert json.loads(wheels[4])["outside_training_range"] == ["slip"]


def test_a_late_message_differs_in_its_mark_alone() -> None:
    """Marking a message as late changes `late` alone, and marking it twice changes nothing more."""
    snapshot, _ = encode(estimate(), SESSION)
    late = as_late(snapshot)
    assert json.loads(late) == json.loads(snapshot) | {"late": True}
    assert as_late(late) == late


@pytest.mark.parametrize("payload", [b'{"schema_version":9}', b"", b"\xff\x00", b"[1, 2]"])
def test_a_payload_of_an_unknown_layout_is_delivered_as_it_is(payload: bytes) -> None:
    """The store may hold what another version wrote; it must not end the daemon."""
    assert as_late(payload) == payload


def test_a_stored_message_of_an_older_schema_keeps_its_version_when_it_is_marked_late() -> None:
    """Messages that an older version stored are delivered after an upgrade, with their own schema version."""
    assert (
        as_late(b'{"schema_version":1,"late":false,"session":"a"}') == b'{"schema_version":1,"late":true,"session":"a"}'
    )


def test_every_model_written_live_can_be_marked_late() -> None:
    """`late` is at the same place in every message, however it was written."""
    state = StateMessage(
        session=SESSION, sequence=1, **time_fields(0), state="online", reason="connected", software_version="0"
    )
    assert json.loads(as_late(write(state.model_dump())))["late"] is True
    assert as_late(state.model_dump_json().encode()) == as_late(write(state.model_dump()))


def test_times_keep_their_nanoseconds() -> None:
    """All nine decimals are written, leading zeros included."""
    assert iso_time(1_370_959_642_018_291_001) == "2013-06-11T14:07:22.018291001Z"
    assert iso_time(1_000_000_007) == "1970-01-01T00:00:01.000000007Z"


def test_documents_are_fresh() -> None:
    """The documents equal what `regolithd schema --write docs/messages` writes."""
    written = {path.name: path.read_text(encoding="utf-8") for path in DOCS.iterdir()}
    assert written == documents(), "run: regolithd schema --write docs/messages"


def test_schemas_accept_what_is_sent_and_refuse_what_is_not() -> None:
    """Each schema is valid JSON Schema 2020-12, accepts an encoded message, and refuses a wrong one."""
    snapshot, wheels = encode(estimate(missing_wheel=2), SESSION)
    for channel in CHANNELS:
        jsonschema.Draft202012Validator.check_schema(json.loads((DOCS / f"{channel.name}.schema.json").read_text()))
    validator = jsonschema.Draft202012Validator(json.loads((DOCS / "snapshot.schema.json").read_text()))
    validator.validate(json.loads(snapshot))
    wrong = json.loads(snapshot) | {"load_N": [1.0] * 5}
    assert [error.json_path for error in validator.iter_errors(wrong)] == ["$.load_N"]
    wheel = jsonschema.Draft202012Validator(json.loads((DOCS / "wheel.schema.json").read_text()))
    wheel.validate(json.loads(wheels[2]))


def test_every_message_has_an_example_that_its_schema_accepts() -> None:
    """The example in the AsyncAPI document is valid against the schema file."""
    document = json.loads((DOCS / "asyncapi.json").read_text())
    for channel in CHANNELS:
        (shown,) = document["components"]["messages"][channel.message.__name__]["examples"]
        schema = json.loads((DOCS / f"{channel.name}.schema.json").read_text())
        jsonschema.Draft202012Validator(schema).validate(shown["payload"])


def test_every_reference_in_the_asyncapi_document_leads_somewhere() -> None:
    """Every reference resolves, and every channel has an operation with QoS and retain flag."""
    document = json.loads((DOCS / "asyncapi.json").read_text())

    def references(node: object) -> list[str]:
        if isinstance(node, dict):
            return [v for k, v in node.items() if k == "$ref"] + [r for v in node.values() for r in references(v)]
        return [r for v in node for r in references(v)] if isinstance(node, list) else []

    found = references(document)
    assert len(found) > 3 * len(CHANNELS)
    for reference in found:
        node = document
        for part in reference.removeprefix("#/").split("/"):
            node = node[part]
    for channel in CHANNELS:
        operation = document["operations"][f"publish-{channel.name}"]
        assert operation["action"] == "send"
        assert operation["bindings"]["mqtt"] == {"qos": int(channel.qos), "retain": channel.retain}


def test_no_message_is_taken_with_a_field_too_many() -> None:
    """A message with an unknown field is refused."""
    snapshot, _ = encode(estimate(), SESSION)
    with pytest.raises(ValidationError):
        SnapshotMessage.model_validate(json.loads(snapshot) | {"extra": 1})


def test_the_readme_of_the_messages_shows_the_example_of_each() -> None:
    """Each block of the page is valid JSON and the channel's example, in the order of the channels."""
    shown = [
        json.loads(block) for block in re.findall(r"```json\n(.*?)\n```", documents()["README.md"], flags=re.DOTALL)
    ]
    assert shown == [example(channel) for channel in CHANNELS]


def test_text_in_an_example_is_written_as_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """Characters such as `Ω` are not escaped."""
    monkeypatch.setattr("regolithd.daemon.messages.documents.example", lambda _: {"remedy": "120 Ω"})
    assert documents()["README.md"].count('"120 Ω"') == len(CHANNELS)
    assert '"120 Ω"' in documents()["asyncapi.json"]
