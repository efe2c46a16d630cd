"""Tables to download: the messages of a time range as CSV or Parquet, one row for each message.

A list of six becomes six columns (`load_N_1` … `load_N_6`), an object one for each of its fields
(`cohesion_Pa_median`); any other list is joined by `;`. The columns of a kind of message are those of its example in
`daemon.messages.examples`, which has every field.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from itertools import islice
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import from_json

from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.examples import example

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from regolithd.daemon.ground.store.history import Message

BATCH = 5000
KINDS = {"snapshot": "snapshot", "posterior": "posterior", "odometry": "odometry", "event": "event", "emcy": "emcy"}
KINDS |= {"alarm": "alarm/*", "node": "node/*", "state": "state", "mismatch": "mismatch"}
"""Kind of table → topic."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its name, and whether it holds text, whole numbers, numbers or truth values."""

    name: str
    type: type[str | int | float | bool]


def flat(content: dict[str, Any]) -> dict[str, Any]:
    """Return a message's fields as columns."""
    row: dict[str, Any] = {}
    for name, value in content.items():
        if isinstance(value, dict):
            row |= {f"{name}_{field}": inner for field, inner in flat(value).items()}
        elif isinstance(value, list) and len(value) == 6 and name != "wheels":
            row |= {f"{name}_{number}": _plain(each) for number, each in enumerate(value, start=1)}
        else:
            row[name] = _plain(value)
    return row


def _plain(value: Any) -> Any:  # noqa: ANN401  # a JSON value
    return ";".join(str(each) for each in value) if isinstance(value, list) else value


def columns(kind: str) -> list[Column]:
    """Return the columns of a kind of message; a field that is null in the example has the type of its model."""
    (channel,) = (channel for channel in CHANNELS if channel.name == kind)
    fields = channel.message.model_fields
    found: list[Column] = []
    for name, value in example(channel).items():
        if value is None:
            found += _of_annotation(name, fields[name].annotation)
        else:
            found += [
                Column(each, float if inner is None else type(inner)) for each, inner in flat({name: value}).items()
            ]
    return found


def _of_annotation(name: str, annotation: Any) -> list[Column]:  # noqa: ANN401  # a type
    """Return the columns of a field that may be null."""
    kind = annotation
    if isinstance(kind, UnionType) or get_origin(kind) is Union:
        kind = next(each for each in get_args(kind) if each is not NoneType)
    if get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        inner = kind.model_fields.items()
        return [column for each, field in inner for column in _of_annotation(f"{name}_{each}", field.annotation)]
    return [Column(name, kind if kind in {int, float, bool} else str)]


def csv_lines(kind: str, messages: Iterable[Message]) -> Iterator[bytes]:
    """Yield a CSV file (RFC 4180, UTF-8): the names, then a row for each message."""
    names = [column.name for column in columns(kind)]
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, names, extrasaction="ignore", restval="")
    writer.writeheader()
    for message in messages:
        writer.writerow(flat(_content(message)))
        if buffer.tell() > 65_536:
            yield buffer.getvalue().encode()
            buffer.seek(0)
            buffer.truncate()
    yield buffer.getvalue().encode()


def write_parquet(kind: str, messages: Iterable[Message], path: Path) -> None:
    """Write a Parquet file."""
    import pyarrow as pa  # noqa: PLC0415  # slow to import
    import pyarrow.parquet as pq  # noqa: PLC0415

    types = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
    wanted = columns(kind)
    schema = pa.schema([(column.name, types[column.type]) for column in wanted])
    remaining = iter(messages)
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        while rows := [flat(_content(message)) for message in islice(remaining, BATCH)]:
            values = {column.name: [_typed(row.get(column.name), column) for row in rows] for column in wanted}
            writer.write_table(pa.table(values, schema=schema))


def _content(message: Message) -> dict[str, Any]:
    content: dict[str, Any] = from_json(message.payload)
    return content | {"late": message.late}


def _typed(value: Any, column: Column) -> Any:  # noqa: ANN401  # a JSON value
    return None if value is None else column.type(value)
