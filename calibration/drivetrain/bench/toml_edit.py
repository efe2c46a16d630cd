"""Values into a TOML file that people write: only the value changes, and comments and order stay as they are."""

from __future__ import annotations

import re
import tomllib

_HEADER = re.compile(r"^\s*\[(?!\[)\s*([^\]]+?)\s*\]")


def set_value(text: str, table: str, key: str, value: float | list[float]) -> str:
    """Return the text with `key` of `[table]` set; a key that is not there is added at the end of its table.

    The value must stand on one line, as it does in `rover.toml`; tested by reading the result.
    """
    lines = text.splitlines()
    start = next((n for n, line in enumerate(lines) if (m := _HEADER.match(line)) and m[1] == table), None)
    written = _written(value)
    if start is None:
        lines += ["", f"[{table}]", f"{key} = {written}"]
    else:
        end = next((n for n in range(start + 1, len(lines)) if _HEADER.match(lines[n])), len(lines))
        at = next((n for n in range(start + 1, end) if re.match(rf"\s*{re.escape(key)}\s*=", lines[n])), None)
        if at is None:
            last = max(n for n in range(start, end) if lines[n].strip())
            lines.insert(last + 1, f"{key} = {written}")
        else:
            lines[at] = _replaced(lines[at], written)
    edited = "\n".join(lines) + "\n"
    found = tomllib.loads(edited)[table][key]
    if found != tomllib.loads(f"x = {written}")["x"]:
        raise ValueError(f"[{table}] {key} could not be written: is its value spread over several lines?")
    return edited


def _written(value: float | list[float]) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_written(each) for each in value) + "]"
    number = f"{value:.6g}"
    return number if re.search(r"[.e]", number) else f"{number}.0"


def _replaced(line: str, written: str) -> str:
    """Return the line with another value; its comment stays in its column where there is room."""
    match = re.match(r"(\s*[^=#]+=\s*)((?:\[[^\]]*\]|\"[^\"]*\"|[^#])*?)(\s*)(#.*)?$", line)
    if match is None:
        raise ValueError(f"cannot be edited: {line}")
    head, _, _, comment = match.groups()
    new = head + written
    if comment is None:
        return new
    return new.ljust(max(line.index(comment, len(head)) - 1, 0)) + " " + comment
