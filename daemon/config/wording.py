"""What is expected of a value in a TOML file, in words: from pydantic's error and the field's own limits."""

from __future__ import annotations

import json
import re
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, get_args

from pydantic import BeforeValidator

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pydantic.fields import FieldInfo
    from pydantic_core import ErrorDetails

_UNITS = {
    "_A_s_per_rad": "A·s/rad",
    "_Nm_per_A": "N·m/A",
    "_per_Nm": "1/(N·m)",
    "_rad_s": "rad/s",
    "_m_s": "m/s",
    "_minutes": "min",
    "_Hz": "Hz",
    "_MB": "MB",
    "_kg": "kg",
    "_ms": "ms",
    "_Pa": "Pa",
    "_deg": "°",
    "_m": "m",
    "_s": "s",
    "_A": "A",
    "_N": "N",
}
"""Endings of keys, the longer ones first: the unit of the value."""
_KINDS = {
    "int": "a whole number",
    "float": "a number",
    "finite": "a number",
    "bool": "true or false",
    "string": "a text in quotes",
    "path": "a path in quotes",
    "tuple": "a list",
    "list": "a list",
    "dict": "a table",
    "model": "a table",
}
"""By the first word of pydantic's type of an error."""
_LIMITS = {"greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number"}
_LENGTHS = {"too_short", "too_long"}


def expected(details: ErrorDetails, field: FieldInfo | None, key: str) -> str:
    """Return what is expected; `field` is the model's field of that key, where it is known."""
    return _by_limits(details, field, key) or _by_kind(details, field)


def _by_limits(details: ErrorDetails, field: FieldInfo | None, key: str) -> str:
    """Return the range or the number of values where these are wrong; otherwise an empty text."""
    kind = details["type"]
    if kind in _LIMITS and field is not None:
        return _range(field, key)
    if kind in _LENGTHS or (kind == "missing" and isinstance(details["loc"][-1], int)):
        return _count(details, field)
    return "a number, or a list of them" if kind == "tuple_type" and _one_for_all(field) else ""


def _by_kind(details: ErrorDetails, field: FieldInfo | None) -> str:
    kind = details["type"]
    if details["loc"] and details["loc"][-1] == "[key]":
        return "a node-ID from 1 to 126"
    if field is not None and field.description and kind.startswith("string"):
        return field.description
    text = re.sub(r"^(Input|Value|String|Tuple) (should (be |have |match )?|error, )", "", details["msg"])
    if kind in {"literal_error", "value_error", "as_written"}:
        return text
    return {"string_too_short": "a text that is not empty", "missing": "a value"}.get(
        kind, _KINDS.get(kind.split("_")[0], text)
    )


def found(details: ErrorDetails) -> str:
    """Return what was found, as TOML writes it."""
    missing = details["type"] == "missing" and not isinstance(details["loc"][-1], int)
    return "nothing" if missing else shown(details["input"])


def shown(value: object) -> str:
    """Return a value as TOML writes it; six equal ones as one, as they may be written."""
    match value:
        case dict():
            return "a table"
        case tuple() | list():
            same = isinstance(value, tuple) and len(value) > 1 and len(set(value)) == 1
            return shown(value[0]) if same else f"[{', '.join(map(shown, value))}]"
        case bool():
            return "true" if value else "false"
        case str() | PurePath():
            return json.dumps(str(value), ensure_ascii=False)
        case None:
            return "none"
        case _:
            return str(value)


def unit_of(key: str) -> str:
    """Return the unit that a key's name ends in, or an empty text."""
    return next((unit for ending, unit in _UNITS.items() if key.removesuffix("_std").endswith(ending)), "")


def _range(field: FieldInfo, key: str) -> str:
    limits: dict[str, Any] = {}
    for limit in _limits(field.metadata, field.annotation):
        limits = {**limit, **limits}
    unit = f" {unit_of(key)}".rstrip()
    low, high = limits.get("ge"), limits.get("le")
    if low is not None and high is not None:
        return f"{low:.12g} to {high:.12g}{unit}"
    words = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
    said = [f"{word} {limits[name]:g}" for name, word in words.items() if name in limits]
    return f"{' and '.join(said)}{unit}" if said else f"a finite number{unit and f' of {unit.strip()}'}"


def _limits(metadata: list[Any], annotation: Any) -> Iterator[Mapping[str, Any]]:  # noqa: ANN401  # any type's
    """Yield the limits of a field, and of what its lists hold."""
    for each in metadata:
        yield {name: getattr(each, name) for name in ("gt", "ge", "lt", "le") if getattr(each, name, None) is not None}
        yield from _limits(getattr(each, "metadata", []), None)
    for inner in get_args(annotation):
        yield from _limits([inner], inner)


def _one_for_all(field: FieldInfo | None) -> bool:
    """Return whether one number may stand for a list of six."""
    return field is not None and any(isinstance(each, BeforeValidator) for each in field.metadata)


def _count(details: ErrorDetails, field: FieldInfo | None) -> str:
    """Return how many values are expected: as many as the limits say, or as the tuple has."""
    context = details.get("ctx", {})
    number = context.get("min_length", context.get("max_length"))
    if number is None and field is not None:
        number = len(get_args(field.annotation))
    return f"{number} values{', or one for all' if _one_for_all(field) else ''}"
