"""Random changes of what well-formed files hold, from a seed: types of Parquet columns, values of JSON messages."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.compute as pc

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

VALUES = (None, True, 0, -1, 1e308, -1e-308, 10**30, float("nan"), float("inf"), "", "1,5", "x" * 300, [], [1, 2], {})
"""What a mutation writes in place of a value of JSON."""
TOML_VALUES = ("0", "-1", "0.004", "1.5", "1e308", "nan", "inf", "true", '""', '"x"', "[]", "[1, 2]", "[3]", "{}")
"""What it writes in place of a value of TOML."""
RENAMED = ("", "t_s", "wheel", "run", "t_ms", "load_N ", "Load_N", "motor_current_mA", "°C", "a" * 300)
"""What a mutation calls a column."""


def damaged_json(content: bytes, random: Random) -> bytes:
    """Return a message with one value, key or item changed, removed or repeated; some are no JSON any more."""
    if random.random() < 0.1:
        return content[: random.randrange(len(content))]
    message = json.loads(content)
    place = message
    while True:
        keys: list[Any] = list(place) if isinstance(place, dict) else list(range(len(place)))
        if not keys:
            break
        key = random.choice(keys)
        inner = place[key]
        if not (isinstance(inner, dict | list) and inner and random.random() < 0.7):
            _change(place, key, random)
            break
        place = inner
    return json.dumps(message).encode()


def damaged_value(text: str, random: Random) -> str:
    """Return TOML in which one value is another; it is well-formed still."""
    lines = text.splitlines(keepends=True)
    at = random.choice([number for number, line in enumerate(lines) if " = " in line])
    key, _ = lines[at].split(" = ", 1)
    lines[at] = f"{key} = {random.choice(TOML_VALUES)}\n"
    return "".join(lines)


def _change(place: Any, key: Any, random: Random) -> None:
    match random.randrange(3):
        case 0:
            del place[key]
        case 1 if isinstance(place, list):
            place.append(place[key])
        case 1:
            place[f"{key}{random.choice(('', '_', 's'))}"] = place[key]
        case _:
            place[key] = random.choice(VALUES)


def damaged_table(table: pa.Table, random: Random) -> pa.Table:
    """Return a table with one to three columns of another type, name, place or content, or other rows."""
    for _ in range(random.randint(1, 3)):
        table = random.choice(_OF_TABLE)(table, random)
    return table


def _with(table: pa.Table, at: int, column: pa.Array) -> pa.Table:
    return table.set_column(at, table.column_names[at], column)


def _as_text(column: pa.ChunkedArray) -> pa.Array:
    return pa.array([None if v is None else str(v) for v in column.to_pylist()])


_TYPES: tuple[Callable[[pa.ChunkedArray], Any], ...] = (
    _as_text,
    lambda column: _as_text(column).cast(pa.binary()),
    lambda column: _as_text(column).dictionary_encode(),
    lambda column: pa.array([None if v is None else bool(v) for v in column.to_pylist()]),
    lambda column: pa.array([None if v is None else [v, v] for v in column.to_pylist()]),
    lambda column: pa.array([None if v is None else {"value": v} for v in column.to_pylist()]),
    lambda column: pa.nulls(len(column)),
    lambda column: pc.cast(column, pa.int64(), safe=False),
    lambda column: pc.cast(pc.cast(column, pa.int64(), safe=False), pa.timestamp("ns")),
    lambda column: pc.cast(pc.cast(column, pa.int64(), safe=False), pa.duration("ms")),
    lambda column: pc.cast(column, pa.float32()),
    lambda column: pa.array([None if v is None else f"{v}".replace(".", ",") for v in column.to_pylist()]),
)
"""What a column's type becomes."""


def _retype(table: pa.Table, random: Random) -> pa.Table:
    at = random.randrange(table.num_columns)
    try:
        return _with(table, at, random.choice(_TYPES)(table.column(at)))
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError, ValueError, TypeError, OverflowError):
        return table


def _blank(table: pa.Table, random: Random) -> pa.Table:
    at, share = random.randrange(table.num_columns), random.choice((0.01, 0.3, 0.9, 1.0))
    values = table.column(at).to_pylist()
    kept = [None if random.random() < share else value for value in values]
    return _with(table, at, pa.array(kept, table.column(at).type))


def _rename(table: pa.Table, random: Random) -> pa.Table:
    names = list(table.column_names)
    names[random.randrange(len(names))] = random.choice((*RENAMED, *names))
    return table.rename_columns(names)


def _drop(table: pa.Table, random: Random) -> pa.Table:
    return table.remove_column(random.randrange(table.num_columns)) if table.num_columns > 1 else table


def _repeat(table: pa.Table, random: Random) -> pa.Table:
    at = random.randrange(table.num_columns)
    return table.add_column(random.randint(0, table.num_columns), table.column_names[at], table.column(at))


def _rows(table: pa.Table, random: Random) -> pa.Table:
    match random.randrange(4):
        case 0:
            return table.slice(0, random.choice((0, 1, 2, 50, table.num_rows // 2)))
        case 1:
            return pa.concat_tables([table, table])
        case 2 if table.num_rows:
            order = list(range(table.num_rows))
            random.shuffle(order)
            return table.take(order)
        case _:
            return table.slice(random.randint(0, table.num_rows))


_OF_TABLE: tuple[Callable[[pa.Table, Random], pa.Table], ...] = (
    _retype,
    _retype,
    _blank,
    _rename,
    _drop,
    _repeat,
    _rows,
)
