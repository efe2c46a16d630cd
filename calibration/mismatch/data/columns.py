"""Columns of a long table: read from CSV or Parquet, or taken from a data frame, each as an array of numbers.

A mistake in a file is one `RecordingError` with file, line and column, and with what to change.
"""

from __future__ import annotations

import gzip
import math
import re
import zlib
from collections import Counter
from collections.abc import Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import RecordingError, counted, listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

Column = NDArray[Any]
"""Numbers; text in the column that tells wheels apart."""

NUMBERS_NEEDED = frozenset({"t_s", "t_ms", "t_us", "t_ns", "t_min", "t_h", "run"})
"""Columns in which text is an error, however much of it there is."""
ROVER = "rover"
"""The column that tells rovers apart, where a file has several."""
ROWS_AT_ONCE = 65_536
"""Rows that are read at once where only a part of a file is wanted (a choice)."""
PARQUET = b"PAR1"
MCAP = b"\x89MCAP"
_FOREIGN = {
    PARQUET: "is a Parquet file: give it the ending .parquet",
    MCAP: "is an MCAP file: give it the ending .mcap",
    b"\xff\xfe": "is UTF-16: save it as UTF-8",
    b"\xfe\xff": "is UTF-16: save it as UTF-8",
    b"PK\x03\x04": "is a zip archive or a spreadsheet: save it as CSV",
}
"""What a file that is called CSV begins with, where it is none."""


@dataclass(frozen=True)
class Columns:
    """Columns by name.

    Attributes
    ----------
    numbers: those that can be computed with, and the one that names wheels, which may be text
    unread: those that hold something else, each with what that is
    """

    numbers: dict[str, Column] = field(default_factory=dict)
    unread: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class _Source:
    """Where a table came from, for messages; a text file's second line is its first row."""

    prefix: str = ""
    counted: str = "row"

    def number(self, row: int) -> str:
        """Return "line 7" or "row 6" for a row counted from 0."""
        return f"{self.counted} {row + (2 if self.counted == 'line' else 1)}"


def file_columns(path: Path, unit: str, rover: str | None = None, rows: tuple[int, int] | None = None) -> Columns:
    """Read CSV (also .gz) or Parquet; of a file with several rovers, the rows of one.

    `rows` of a Parquet file are read alone, from the first to before the last.

    Raises
    ------
    RecordingError
        When the file is none of these, or a cell is no number.
    """
    if not path.is_file():
        raise RecordingError(f"{path} is not there" if not path.exists() else f"{path} is not a file")
    table = _table(path) if rows is None else _parquet_rows(path, *rows)
    if rover is not None:
        table = table.filter(_text(table, ROVER) == rover).drop_columns([ROVER])
    found = _columns(table, unit, _Source(f"{path}: ", "row" if path.suffix == ".parquet" else "line"))
    del table
    return_memory()
    return found


def return_memory() -> None:
    """Return to the system what Arrow keeps of the tables that it has read, for those that it may read next."""
    import pyarrow as pa  # noqa: PLC0415

    pa.default_memory_pool().release_unused()


def rovers_in(path: Path) -> tuple[str, ...]:
    """Return the rovers that the column `rover` of a CSV or Parquet file names, in ascending order; empty: it has none.

    Raises
    ------
    RecordingError
        When the file cannot be read.
    """
    if path.suffix == ".parquet":
        names = _texts_in_parquet(path, ROVER)
    elif ROVER.encode() in _first_line_of(path):
        table = _csv_table(path)
        names = set(_text(table, ROVER)) if ROVER in table.column_names else set()
    else:
        names = set()
    return tuple(sorted(str(name) for name in names if name))


def _texts_in_parquet(path: Path, name: str) -> set[str]:
    """Return what a column holds, as text, with no more than a batch of it in memory; nothing without this column."""
    import pyarrow.parquet  # noqa: PLC0415

    with parquet_errors(path):
        file = pyarrow.parquet.ParquetFile(path)
        if name not in file.schema_arrow.names:
            return set()
        return {text for batch in file.iter_batches(ROWS_AT_ONCE, columns=[name]) for text in _text(batch, name)}


def _first_line_of(path: Path) -> bytes:
    """Return a text file's first line, unpacked; empty where it cannot be: reading the whole then says why."""
    try:
        with path.open("rb") as raw:
            packed = raw.read(2) == b"\x1f\x8b"
        with gzip.open(path, "rb") if packed else path.open("rb") as file:
            return file.readline(1 << 16)
    except (OSError, EOFError, zlib.error):
        return b""


def _table(path: Path) -> Any:  # noqa: ANN401  # pyarrow has no types
    return _parquet_table(path) if path.suffix == ".parquet" else _csv_table(path)


def _text(table: Any, name: str) -> NDArray[Any]:  # noqa: ANN401
    """Return a column as text, empty where it is blank."""
    return np.array(["" if cell is None else str(cell) for cell in table.column(name).to_pylist()])


def frame_columns(frame: object, unit: str) -> Columns:
    """Take the columns of a pandas, polars or pyarrow table, or of a mapping from names to sequences of equal length.

    Raises
    ------
    RecordingError
        When it is none of these, its columns have different lengths, or a cell is no number.
    """
    import pyarrow as pa  # noqa: PLC0415  # arrays that are arranged already do without

    try:
        if hasattr(frame, "__arrow_c_stream__"):
            table = pa.table(frame)
        elif isinstance(frame, Mapping) or (hasattr(frame, "keys") and hasattr(frame, "__getitem__")):
            table = pa.table({str(name): np.asarray(frame[name]) for name in frame.keys()})  # noqa: SIM118
        else:
            raise RecordingError(
                f"a {type(frame).__name__} is no data frame (pandas, polars, pyarrow) and no mapping of arrays"
            )
    except (pa.ArrowException, TypeError) as error:
        raise RecordingError(f"this is no table with one value for each row and column: {error}") from error
    return _columns(table, unit, _Source())


@contextmanager
def parquet_errors(path: Path) -> Iterator[None]:
    """Tell what goes wrong with a Parquet file as one error that names it."""
    import pyarrow as pa  # noqa: PLC0415

    try:
        yield
    except (pa.ArrowException, OSError, ValueError, KeyError, MemoryError, OverflowError) as error:
        why = _first_line(error).removesuffix(".")
        raise RecordingError(f"{path} is not a whole Parquet file: {why}. Copy or export it again.") from error


def _parquet_table(path: Path) -> Any:  # noqa: ANN401  # pyarrow has no types
    import pyarrow.parquet  # noqa: PLC0415

    with parquet_errors(path):
        # One file: no dataset, whose folder names would become columns.
        return pyarrow.parquet.ParquetFile(path).read()


def _parquet_rows(path: Path, first: int, last: int) -> Any:  # noqa: ANN401  # pyarrow has no types
    """Return some rows of a Parquet file, with no more than a batch of others in memory."""
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet  # noqa: PLC0415

    with parquet_errors(path):
        file, found, row = pyarrow.parquet.ParquetFile(path), [], 0
        for group in range(file.num_row_groups):
            if row >= last:
                break
            if row + (size := file.metadata.row_group(group).num_rows) <= first:
                row += size
                continue
            for batch in file.iter_batches(ROWS_AT_ONCE, row_groups=[group]):
                if row >= last:
                    break
                begins, ends = max(first - row, 0), min(last - row, batch.num_rows)
                found.append(batch.slice(begins, max(ends - begins, 0)))
                row += batch.num_rows
        return pa.Table.from_batches(found)


def _csv_table(path: Path) -> Any:  # noqa: ANN401
    import pyarrow.csv  # noqa: PLC0415

    text = _csv_bytes(path)
    for beginning, told in _FOREIGN.items():
        if text.startswith(beginning):
            raise RecordingError(f"{path} {told}")
    if not text.strip():
        raise RecordingError(f"{path} is empty")
    if b"\0" in text[:4096]:
        raise RecordingError(f"{path} is no text: save it as CSV in UTF-8")
    try:
        table = pyarrow.csv.read_csv(pyarrow.BufferReader(text))
    except (pyarrow.ArrowException, ValueError, OverflowError) as error:
        raise RecordingError(f"{path}{_what_is_wrong(text, _told_with_line(text, error))}") from error
    if any(pyarrow.types.is_binary(kind) for kind in table.schema.types):  # text that is not UTF-8
        raise RecordingError(f"{path}{_what_is_wrong(text, 'a column is not text')}")
    return table


def _csv_bytes(path: Path) -> bytes:
    content = path.read_bytes()
    if not content.startswith(b"\x1f\x8b"):
        if path.suffix == ".gz" and content:
            raise RecordingError(f"{path} is not compressed by gzip: give it the ending .csv")
        return content
    try:
        return gzip.decompress(content)
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(f"{path} cannot be decompressed ({error}): it is damaged or cut off") from error


def _told_with_line(text: bytes, error: Exception) -> str:
    """Return the reader's complaint with the line, which it tells only when it reads with one thread."""
    import pyarrow.csv  # noqa: PLC0415

    try:
        options = pyarrow.csv.ReadOptions(use_threads=False)
        pyarrow.csv.read_csv(pyarrow.BufferReader(text), read_options=options)
    except (pyarrow.ArrowException, ValueError, OverflowError) as again:
        return str(again)
    return str(error)


def _what_is_wrong(text: bytes, told: str) -> str:
    """Return the line and the cure for what the CSV reader complains about."""
    if found := re.search(r"Row #(\d+): Expected (\d+) columns, got (\d+)", told):
        row, expected, got = found.groups()
        if expected == "1" and (separated := _separated_otherwise(text.split(b"\n", 1)[0].decode(errors="replace"))):
            return f": {separated}"
        return (
            f", line {row}: {counted(int(got), 'cell')}, but {expected} columns in the first line. Complete the line "
            "or remove it; commas separate cells, and a decimal comma has to be a point."
        )
    try:
        text.decode("utf-8")
    except UnicodeDecodeError as error:
        line = text.count(b"\n", 0, error.start) + 1
        column = error.start - text.rfind(b"\n", 0, error.start)
        return f", line {line}, character {column}: this is not UTF-8. Save the file as UTF-8."
    return f" is no table that can be read: {told.splitlines()[0]}"


def _columns(table: Any, unit: str, source: _Source) -> Columns:  # noqa: ANN401
    """Return the columns that are numbers, and the one that tells the machine's parts apart, which may be text.

    A column of text that is mostly numbers has a cell that is wrong: an error names the first. Other text is not read.
    """
    names = _names(table, source.prefix)
    found = Columns()
    for number, name in enumerate(names):
        column = table.column(number)
        try:
            values = as_numbers(column)
            if values is None and name == unit:
                values = _as_names(column)
            cells = column.to_pylist() if values is None else []
        except (ValueError, OverflowError, NotImplementedError) as error:  # pyarrow's errors are among them
            raise RecordingError(f"{source.prefix}column {name} cannot be read: {_first_line(error)}") from error
        if values is None:
            values = _parsed(name, cells, str(column.type), source, found.unread)
        if values is not None:
            found.numbers[name] = values
    return found


def _separated_otherwise(first_line: str) -> str:
    """Return what is told of a first line without commas whose columns are separated by something else."""
    mark = next((mark for mark in ";\t|" if mark in first_line), "")
    return f"columns are separated by {mark!r}; write commas, and points in numbers." if mark else ""


def _names(table: Any, place: str) -> list[str]:  # noqa: ANN401
    """Return the columns' names without spaces around them."""
    try:
        names = [name.strip() for name in table.column_names]
    except UnicodeDecodeError as error:
        raise RecordingError(f"{place}the columns' names are not UTF-8. Save the file as UTF-8.") from error
    if len(names) == 1 and (separated := _separated_otherwise(names[0])):
        raise RecordingError(f"{place}{separated}")
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise RecordingError(f"{place}more than one column is called {listed(twice)}. Rename or remove all but one.")
    return names


def as_numbers(column: Any) -> Column | None:  # noqa: ANN401
    """Return a column of numbers, None where its type is something else."""
    import pyarrow as pa  # noqa: PLC0415

    kind = column.type
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    if pa.types.is_boolean(kind):
        column = column.cast(pa.uint8())
    elif pa.types.is_decimal(kind):
        column = column.cast(pa.float64())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return None
    # Not pyarrow's `to_numpy`, `fill_null` or, of what are numbers already, `cast`: they load pandas or all of Arrow's
    # functions, which takes longer than reading the file.
    whole = column.combine_chunks()
    if not len(whole):
        return np.zeros(0)
    known, numbers = whole.buffers()
    here = slice(whole.offset, whole.offset + len(whole))
    # An integer above 2^53 is rounded.
    values = np.frombuffer(numbers, whole.type.to_pandas_dtype())[here].astype(np.float64)
    if known is None:
        return values
    return np.where(np.unpackbits(np.frombuffer(known, np.uint8), bitorder="little")[here], values, np.nan)


def _as_names(column: Any) -> Column | None:  # noqa: ANN401
    """Return a column of text."""
    import pyarrow as pa  # noqa: PLC0415

    kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    if not any(test(kind) for test in (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view)):
        return None
    return np.array([value or "" for value in column.to_pylist()], dtype=object).astype(str)


def _parsed(name: str, cells: Sequence[object], kind: str, source: _Source, unread: dict[str, str]) -> Column | None:
    """Return text as numbers where it is some; else note what it is.

    Raises
    ------
    RecordingError
        Where most cells are numbers and one is not: a typing error, not a column of text.
    """
    read = [_number(cell) for cell in cells]
    wrong = [row for row, number in enumerate(read) if number is None]
    if not wrong:
        return np.array(read, np.float64)
    first = f"{str(cells[wrong[0]])[:30]!r}"
    if name in NUMBERS_NEEDED and not kind.endswith("string"):
        raise RecordingError(
            f"{source.prefix}column {name} holds {kind}; numbers are needed, for the time those from the start."
        )
    known = sum(number is None or not math.isnan(number) for number in read)
    if name in NUMBERS_NEEDED or len(wrong) <= known / 2:
        raise RecordingError(
            f"{source.prefix}{source.number(wrong[0])}, column {name}: {first} is not a number. Leave a cell empty "
            "where nothing was measured."
        )
    held = "text" if kind.endswith("string") else kind
    unread[name] = f"column {name} holds {held} ({first} in {source.number(wrong[0])}), not numbers"
    return None


def _number(cell: object) -> float | None:
    """Return a cell as a number; NaN where it is empty, None where it is none."""
    if cell is None:
        return float("nan")
    if not isinstance(cell, str):
        return None
    try:
        return float(cell) if cell.strip() else float("nan")
    except ValueError:
        return None


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
