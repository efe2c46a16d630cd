"""Edits of TOML files that people write: values change; comments, order and layout stay (tomlkit)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import tomlkit
from tomlkit.container import OutOfOrderTableProxy
from tomlkit.items import AbstractTable, AoT, Item

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tomlkit import TOMLDocument


def to_toml(tables: Mapping[str, Any]) -> str:
    """Return tables as TOML."""
    return with_tables("", tables)


def with_tables(text: str, tables: Mapping[str, Any]) -> str:
    """Return the text with the content of `tables`: what differs is replaced, added or removed, the rest is as it was.

    A list of tables (`[[effects]]`) is continued where it begins as before; a table inside one is written inline.
    """
    document = tomlkit.parse(text)
    _update(document, tables)
    return tomlkit.dumps(document)


def _update(found: TOMLDocument | AbstractTable | OutOfOrderTableProxy, wanted: Mapping[str, Any]) -> None:
    """Give a document or table the content of `wanted`."""
    for key in [key for key in found if key not in wanted]:
        del found[key]
    for key, value in wanted.items():
        present = found.get(key)
        if isinstance(value, Mapping):
            if not isinstance(present, AbstractTable | OutOfOrderTableProxy):
                found[key] = present = tomlkit.table()
            _update(present, value)
        elif _is_list_of_tables(value):
            _continue(found, key, value)
        elif present is None or present != value:
            set_item(found, key, value)


def _is_list_of_tables(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(each, Mapping) for each in value)


def _continue(
    found: TOMLDocument | AbstractTable | OutOfOrderTableProxy, key: str, tables: Sequence[Mapping[str, Any]]
) -> None:
    """Append the tables that a list does not have yet; write it anew where it begins otherwise."""
    present = found.get(key)
    if not isinstance(present, AoT) or present.unwrap() != list(tables[: len(present)]):
        found[key] = present = tomlkit.aot()
    for table in tables[len(present) :]:
        written = tomlkit.table()
        written.trivia.indent = "\n"
        for name, value in table.items():
            written.add(name, _inline(value) if isinstance(value, Mapping) else value)
        present.append(written)


def _inline(values: Mapping[str, Any]) -> Item:
    written = tomlkit.inline_table()
    written.update(values)
    return written


def set_item(table: Any, key: str, value: object) -> None:  # noqa: ANN401  # a document, or whatever holds a table
    """Set a value of a parsed table; the comment behind it stays in its column where there is room."""
    before = table.get(key)
    room = len(before.as_string()) + len(before.trivia.comment_ws) if isinstance(before, Item) else 0
    table[key] = value
    after = table[key]
    if isinstance(after, Item) and after.trivia.comment:
        after.trivia.comment_ws = " " * max(room - len(after.as_string()), 1)
