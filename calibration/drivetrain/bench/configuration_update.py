"""Update of single values in a configuration file; its comments, order and layout stay."""

from __future__ import annotations

import re
from dataclasses import dataclass

import tomlkit
from tomlkit.items import Table

from regolithd.calibration.toml_document import set_item


@dataclass(frozen=True, slots=True)
class ConfigurationUpdate:
    """The updated text of a configuration file, and one message for each result of the fit or changed value."""

    text: str
    messages: list[str]


def set_value(text: str, table: str, key: str, value: float | list[float]) -> str:
    """Return the TOML text with `key` of `[table]` set; an absent key or table is appended.

    Numbers are written with six significant digits. A comment behind the value stays in its column if there is room.
    """
    document = tomlkit.parse(text)
    section = document.setdefault(table, tomlkit.table())
    if not isinstance(section, Table):
        raise TypeError(f"{table} is not a table of the configuration")
    set_item(section, key, tomlkit.value(_toml(value)))
    return tomlkit.dumps(document)


def _toml(value: float | list[float]) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_toml(each) for each in value) + "]"
    number = f"{value:.6g}"
    return number if re.search(r"[.e]", number) else f"{number}.0"
