"""The Telegraf configuration and the Grafana dashboard use topics and fields that the messages have."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.examples import example

if TYPE_CHECKING:
    from collections.abc import Iterator

FOLDER = Path(__file__).parents[2] / "docs/how-to/grafana"
(MQTT,) = tomllib.loads((FOLDER / "telegraf.conf").read_text())["inputs"]["mqtt_consumer"]
PANELS = json.loads((FOLDER / "dashboard.json").read_text())["panels"]
QUERIES = [(panel["title"], target["query"]) for panel in PANELS for target in panel["targets"]]


def flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the fields that Telegraf's JSON parser makes: parts are joined by `_`, members of a list counted from 0."""
    if isinstance(value, dict | list):
        for key, each in value.items() if isinstance(value, dict) else enumerate(value):
            yield from flat(f"{name}_{key}" if name else str(key), each)
    else:
        yield name, value


def kept(message: dict[str, Any]) -> set[str]:
    """Return the names of the fields that the configuration keeps; null may be a number in another message."""
    texts = (str, bool)
    return {
        name for name, value in flat("", message) if name in MQTT["json_string_fields"] or not isinstance(value, texts)
    }


FIELDS = {channel.name: kept(example(channel)) for channel in CHANNELS}


def test_each_topic_is_one_that_is_published_and_gets_its_name_as_measurement() -> None:
    """Topics, and the patterns that give measurement and rover, have the levels of the published ones."""
    published = {re.sub(r"\{\w+\}", "+", f"regolith/+/{channel.address}") for channel in CHANNELS}
    assert set(MQTT["topics"]) <= published
    for pattern in MQTT["topic_parsing"]:
        levels = len(pattern["topic"].split("/"))
        assert {len(pattern[key].split("/")) for key in ("measurement", "tags")} == {levels}
        assert pattern["measurement"].split("/")[2] == "measurement"
        assert pattern["tags"].split("/")[1] == "rover"
    lengths = {len(pattern["topic"].split("/")) for pattern in MQTT["topic_parsing"]}
    assert {len(topic.split("/")) for topic in MQTT["topics"]} == lengths


def test_the_time_of_every_message_is_read_to_the_nanosecond() -> None:
    """InfluxDB keeps one point for each time and tags: two snapshots of one millisecond would be one."""
    assert MQTT["json_time_format"] == "2006-01-02T15:04:05.999999999Z07:00"  # Go's way to write RFC 3339
    for channel in CHANNELS:
        assert re.fullmatch(r"\d{4}(-\d\d){2}T\d\d(:\d\d){2}\.\d{9}Z", example(channel)[MQTT["json_time_key"]])


@pytest.mark.parametrize(("title", "query"), QUERIES, ids=[title for title, _ in QUERIES])
def test_a_panel_asks_for_fields_that_telegraf_stores(title: str, query: str) -> None:
    """Every field of the query is one of its measurement's."""
    measurement = re.search(r'FROM "(\w+)"', query)
    assert measurement, title
    asked = set(re.findall(r'(?:mean|last)\("(\w+)"\)', query))
    assert asked
    assert asked <= FIELDS[measurement[1]]
