"""The keys of the answer as Markdown, from its JSON Schema."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.answer import answer_schema

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

TITLES = {"calibrated_parameter": "An entry of `parameters`", "parameter": "A value of an effect's `parameters`"}
"""Headings of parts whose name is not that of their key."""


def answer_tables() -> str:
    """Return a table for the whole answer and for each of its parts."""
    return "\n".join(_sections(answer_schema()))


def _sections(schema: Mapping[str, Any]) -> Iterator[str]:
    yield "## The whole answer\n"
    yield from _table(schema)
    for name, part in schema["$defs"].items():
        yield f"## {TITLES.get(name, f'`{name}`')}\n"
        yield f"{part['description']}\n"
        yield from _table(part)


def _table(part: Mapping[str, Any]) -> Iterator[str]:
    yield "| key | type | meaning |\n|---|---|---|"
    yield (
        "\n".join(f"| `{key}` | {_type(value)} | {_cell(value)} |" for key, value in part["properties"].items()) + "\n"
    )


def _type(value: Mapping[str, Any]) -> str:
    """Return a value's type in words."""
    if "const" in value or "enum" in value:
        return ", ".join(f"`{each}`" for each in value.get("enum", [value.get("const")]))
    if any_of := value.get("oneOf", value.get("anyOf")):
        return " or ".join(_type(each) for each in any_of)
    if "$ref" in value:
        return _linked(value["$ref"])
    return _json_type(value)


def _json_type(value: Mapping[str, Any]) -> str:
    """Return what `type` says, with what is inside a list or an object."""
    if value["type"] == "array":
        return f"list of {_type(value['items'])}"
    if value["type"] == "object":
        return f"object of {_type(value['additionalProperties'])}"
    return " or ".join(value["type"]) if isinstance(value["type"], list) else str(value["type"])


def _linked(reference: str) -> str:
    name = reference.rsplit("/", 1)[-1]
    heading = TITLES.get(name, name)
    anchor = heading.lower().replace("`", "").replace("'", "").replace(" ", "-")
    return f"[{name.replace('_', ' ')}](#{anchor})"


def _cell(value: Mapping[str, Any]) -> str:
    return str(value.get("description", "")).replace("|", "\\|")
