"""Programs of others read a recording: Foxglove's packages under Node.js, Lichtblick's layout, PlotJuggler's rules."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from mcap.reader import make_reader
from recorded_traverse import drive_traverse

from regolithd.daemon.recording.layout import layout
from regolithd.daemon.recording.schemas import SCHEMAS

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[3]
PACKAGES = ROOT / "build/npm"
PROGRAM = ROOT / "tests/bench/npm/read_mcap.js"


def node(argument: str | Path) -> Any:
    """Return what the program prints."""
    command = shutil.which("node")
    if command is None or not (PACKAGES / "node_modules/@mcap/core").is_dir():
        pytest.skip("Foxglove's packages are not here: apt-get install nodejs npm, then .ci/test-packages")
    done = subprocess.run(
        [command, PROGRAM, argument], capture_output=True, check=False, env={"NODE_PATH": PACKAGES / "node_modules"}
    )
    assert done.returncode == 0, done.stderr.decode()
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a recorded minute."""
    return drive_traverse(tmp_path_factory.mktemp("drive"), 1, 60.0, 0.0).recording.directory


def test_foxgloves_reader_finds_all_messages_and_their_schemas(recordings: Path) -> None:
    """The file's index leads to every message; a message has the fields of its schema and no other."""
    (recording,) = recordings.glob("*.mcap")
    found = node(recording)
    assert found["messages"] == {"snapshot": 120, "estimate": 120}
    assert found["schemas"] == {topic: SCHEMAS[topic] for topic in found["messages"]}
    for topic, message in found["first"].items():
        assert message.keys() <= SCHEMAS[topic]["properties"].keys()


def keywords(schema: Any) -> Iterator[tuple[str, str]]:
    """Yield every keyword of a JSON Schema, with its value where that is a type."""
    for keyword, value in schema.items():
        yield keyword, value if keyword == "type" else ""
        inner = value.values() if keyword == "properties" else [value] if keyword == "items" else []
        for each in inner:
            yield from keywords(each)


def test_the_schemas_have_only_what_foxgloves_own_schemas_have() -> None:
    """Foxglove's parser takes the keywords and types of the schemas that Foxglove publishes."""
    published = {each for schema in node("--published").values() for each in keywords(schema)}
    used = {each for schema in SCHEMAS.values() for each in keywords(schema)}
    assert {("type", "number"), ("type", "object"), ("properties", "")} <= used
    assert used <= published


def fields(schema: dict[str, Any], place: str) -> Iterator[str]:
    """Yield the message path of every field, as Lichtblick and Foxglove write it."""
    for name, field in schema["properties"].items():
        yield f"{place}.{name}"
        if field["type"] == "object":
            yield from fields(field, f"{place}.{name}")


def test_every_line_of_the_layout_is_a_field_of_the_recording(recordings: Path) -> None:
    """The layout lies beside the recording; its panels are those of its tree, and draw numbers that exist."""
    made = json.loads((recordings / "lichtblick-layout.json").read_text())
    assert made == layout()
    assert set(re.findall(r"Plot!\w+", json.dumps(made["layout"]))) == made["configById"].keys()
    known = {path for topic, schema in SCHEMAS.items() for path in fields(schema, topic)}
    drawn = [path["value"] for panel in made["configById"].values() for path in panel["paths"]]
    assert len(drawn) == len(set(drawn)) == 33
    assert set(drawn) <= known


def plotted(name: str, value: Any) -> Iterator[str]:
    """Yield the series that PlotJuggler 3.17 makes of a JSON message: numbers and truth values; no text, no null."""
    if isinstance(value, dict):
        for key, each in value.items():
            yield from plotted(f"{name}/{key}", each)
    elif isinstance(value, int | float):
        yield name


def numbers(schema: dict[str, Any], place: str) -> Iterator[str]:
    """Yield the path of every number and truth value of a schema, as PlotJuggler writes it."""
    for name, field in schema["properties"].items():
        if field["type"] == "object":
            yield from numbers(field, f"{place}/{name}")
        elif field["type"] != "string":
            yield f"{place}/{name}"


NOT_IN_THE_DRIVE = re.compile(r"/(motor_temperature_degC|bus_voltage_V|soil_change/.*)")
"""What this drive has no sensor or no occasion for."""


def test_plotjuggler_gets_a_series_of_every_number(recordings: Path) -> None:
    """It takes its parser by the channel's encoding and the time from the file; arrays would have numbers for names."""
    (recording,) = recordings.glob("*.mcap")
    found: set[str] = set()
    with recording.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            assert channel.message_encoding == "json"
            content = json.loads(message.data)
            assert message.log_time == message.publish_time == content["time_ns"]
            found |= set(plotted(channel.topic, content))
    expected = {path for topic in ("snapshot", "estimate") for path in numbers(SCHEMAS[topic], topic)}
    assert found == {path for path in expected if not NOT_IN_THE_DRIVE.search(path)}
